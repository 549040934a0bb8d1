"use strict";
// Each `.stage`: a range input over two stacked pictures; its value is where ours ends.
for (const stage of document.querySelectorAll(".stage")) {
  const slider = stage.querySelector("input");
  const move = (value) => {
    if (value !== undefined) slider.value = value;
    stage.style.setProperty("--split", `${slider.value}%`);
    const ours = Math.round(slider.value);
    slider.setAttribute("aria-valuetext", `${ours} % ours, ${100 - ours} % Mitsuba`);
  };
  slider.addEventListener("input", () => move());
  for (const button of stage.parentElement.querySelectorAll("button[data-split]")) {
    button.addEventListener("click", () => move(button.dataset.split));
  }
  // On a card the mouse moves the divider without a button, and a click opens the page.
  const page = stage.dataset.page;
  if (page) {
    stage.addEventListener("pointermove", (event) => {
      const box = stage.getBoundingClientRect();
      if (event.pointerType === "mouse") move((100 * (event.clientX - box.left)) / box.width);
    });
    stage.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && move(100));
    stage.addEventListener("click", (event) => {
      if (event.pointerType === "mouse") location.href = page;
    });
  }
  move();
}
