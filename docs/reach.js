// What scrolls sideways gets the focus, so that the keyboard reaches all of it.
const BOXES = ".md-typeset__scrollwrap, .md-typeset pre > code, math[display=block], p:has(> img)";

function reach() {
  for (const box of document.querySelectorAll(BOXES)) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
  // The theme makes a landmark of every button that copies.
  for (const buttons of document.querySelectorAll(".md-code__nav")) buttons.role = "none";
}

addEventListener("load", reach);
addEventListener("resize", reach);
