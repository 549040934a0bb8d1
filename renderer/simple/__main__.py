"""`python -m renderer.simple SCENE.xml -o OUT.png`: render a scene file, slowly."""

from renderer.__main__ import command

if __name__ == "__main__":
    command("renderer.simple.command")
