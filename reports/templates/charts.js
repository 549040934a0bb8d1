"use strict";
// Unpacks plotly.js, which stands on the page as text, and draws every chart with it.
(async () => {
  const packed = atob(document.getElementById("plotly").textContent.trim());
  const bytes = Uint8Array.from(packed, (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const library = document.createElement("script");
  library.textContent = await new Response(stream).text();
  document.head.append(library);
  // Dragging zooms and a double click goes back; of plotly's buttons one sends the chart
  // to a server, and none is needed.
  const settings = { responsive: true, displayModeBar: false };
  // A finger that drags over a chart scrolls the page; a mouse zooms.
  const dragmode = matchMedia("(pointer: coarse)").matches ? false : "zoom";
  for (const place of document.querySelectorAll("[data-figure]")) {
    const figure = JSON.parse(place.dataset.figure);
    await Plotly.newPlot(place, figure.data, { ...figure.layout, dragmode }, settings);
    place.classList.add("drawn");
  }
})();
