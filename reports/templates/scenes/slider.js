"use strict";
// Each comparison: a range input over two stacked pictures; its value is where ours ends.
for (const figure of document.querySelectorAll(".compare")) {
  const stage = figure.querySelector(".stage");
  const slider = stage.querySelector("input");
  // The pictures stand on the page once, as data; the slider shows the same data again.
  for (const picture of stage.querySelectorAll("img[data-copy-of]")) {
    picture.src = document.getElementById(picture.dataset.copyOf).src;
  }
  const move = () => {
    stage.style.setProperty("--split", `${slider.value}%`);
    const ours = Math.round(slider.value);
    slider.setAttribute("aria-valuetext", `${ours} % ours, ${100 - ours} % Mitsuba`);
  };
  slider.addEventListener("input", move);
  for (const button of figure.querySelectorAll("button[data-split]")) {
    button.addEventListener("click", () => {
      slider.value = button.dataset.split;
      move();
    });
  }
  move();
  stage.hidden = false;
  figure.querySelector(".views").hidden = false;
}
