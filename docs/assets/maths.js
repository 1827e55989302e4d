// Renders the formulas of a page with KaTeX, which lies beside this file. A formula that KaTeX cannot
// read stays as it was written, marked by its class, and the browser's console says what is wrong.
"use strict";

for (const at of document.querySelectorAll(".arithmatex")) {
  const [, open, formula] = at.textContent.trim().match(/^\\([([])([^]*)\\[)\]]$/);
  try {
    katex.render(formula, at, { displayMode: open === "[", output: "htmlAndMathml" });
  } catch (error) {
    at.classList.add("katex-error");
    console.error(error.message);
  }
}
