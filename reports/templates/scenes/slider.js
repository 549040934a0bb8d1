"use strict";
for (const figure of document.querySelectorAll(".compare")) {
  for (const picture of figure.querySelectorAll("img[data-copy-of]")) {
    picture.src = document.getElementById(picture.dataset.copyOf).src;
  }
  figure.querySelector(".stage").hidden = figure.querySelector(".views").hidden = false;
}
