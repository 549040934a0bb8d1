"use strict";
// Written by `python -m reports`: the bar of all pages in this folder.
{
  const bar = document.querySelector("body > nav");
  const here = location.pathname.split("/").pop() || "index.html";
  for (const [file, title] of {{ pages | tojson }}) {
    const link = bar.appendChild(document.createElement("a"));
    link.href = file;
    link.textContent = title;
  }
  for (const link of bar.children) {
    if (link.getAttribute("href") === here) {
      link.setAttribute("aria-current", "page");
      bar.scrollLeft = link.offsetLeft - bar.clientWidth / 2;
    }
  }
}
