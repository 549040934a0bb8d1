"use strict";
// Draws each chart with plotly.js, a file next to the page, when it comes near the window.
addEventListener("DOMContentLoaded", () => {
  const places = document.querySelectorAll("[data-figure]");
  if (!window.Plotly) {
    for (const place of places) {
      place.style.minHeight = "0";
      place.textContent = `${place.getAttribute("aria-label")} (The chart needs the file plotly.js in the folder of this page.)`;
    }
    return;
  }
  // Dragging zooms and a double click goes back; of plotly's buttons one sends the chart
  // to a server, and none is needed. A finger that drags over a chart scrolls the page.
  const settings = { responsive: true, displayModeBar: false };
  const dragmode = matchMedia("(pointer: coarse)").matches ? false : "zoom";
  const draw = async (place) => {
    const figure = JSON.parse(place.dataset.figure);
    await Plotly.newPlot(place, figure.data, { ...figure.layout, dragmode }, settings);
    place.classList.add("drawn");
  };
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((one) => one.isIntersecting)) {
      near.unobserve(entry.target);
      draw(entry.target);
    }
  }, { rootMargin: "800px" });
  places.forEach((place) => near.observe(place));
  addEventListener("beforeprint", () => places.forEach((place) => place.matches(".drawn") || draw(place)));
});
