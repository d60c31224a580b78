// Makes each piece of code on the page a cell that runs, with Pyodide: Python compiled for browsers.

const PACKAGES = ["numpy", "matplotlib", "casadi"];
const HELPERS = `
import io, os
from contextlib import redirect_stdout
os.environ["MPLBACKEND"] = "agg"

async def run_cell(code):
    """Run code; return what it prints and its last value, that as HTML, open figures as SVG."""
    from matplotlib import pyplot
    from pyodide.code import eval_code_async

    html = ""
    with redirect_stdout(io.StringIO()) as said:
        try:
            value = await eval_code_async(code, globals())
            html = getattr(value, "_repr_html_", lambda: None)() or ""
            if value is not None and not html:
                print(repr(value))
        except Exception as error:
            print(f"{type(error).__name__}: {error}")
    files = [io.StringIO() for _ in pyplot.get_fignums()]
    for number, file in zip(pyplot.get_fignums(), files):
        pyplot.figure(number).savefig(file, format="svg", bbox_inches="tight")
    pyplot.close("all")
    return said.getvalue(), html, [file.getvalue() for file in files]
`;

const form = document.querySelector("#python");
const said = form.querySelector("[role=status]");
const cells = [...document.querySelectorAll(".highlight-python pre")].map(cell);
form.elements.address.value =
  new URLSearchParams(location.search).get("pyodide") ?? form.elements.address.value;
form.addEventListener("submit", start);

/** Put a button and a place for what comes below a piece of code. */
function cell(code) {
  const button = document.createElement("button");
  const output = document.createElement("div");
  button.textContent = "Run";
  button.disabled = true;
  output.setAttribute("aria-live", "polite");
  code.closest(".highlight-python").after(button, output);
  return { code, button, output };
}

/** Load Pyodide, the packages and actionopt; then the cells can be run. */
async function start(event) {
  event.preventDefault();
  const button = form.querySelector("button");
  const address = new URL(`${form.elements.address.value.replace(/\/*$/, "")}/`, location.href).href;
  button.disabled = true;
  try {
    said.textContent = "Python is being loaded ...";
    const { loadPyodide } = await import(`${address}pyodide.mjs`);
    const python = await loadPyodide({ indexURL: address });
    await python.loadPackage(PACKAGES, { errorCallback: () => {} });
    const answer = await fetch(new URL("actionopt.zip", location.href));
    python.unpackArchive(await answer.arrayBuffer(), "zip");
    python.runPython(HELPERS);
    said.textContent = "actionopt is being loaded ...";
    await python.runPythonAsync("import actionopt, casadi");
    for (const one of cells) {
      one.code.contentEditable = "plaintext-only";
      one.button.disabled = false;
      one.button.onclick = () => run(python, one);
    }
    said.textContent = `Python ${python.runPython("import sys; sys.version.split()[0]")} is ready.`;
  } catch (error) {
    button.disabled = false;
    const why = `${error.message ?? error}`.trim().split("\n").at(-1);
    said.textContent = `Python was not loaded from ${address}: ${why}`;
  }
}

/** Run a cell, and put below it what comes of it. */
async function run(python, { code, button, output }) {
  button.disabled = true;
  output.replaceChildren();
  const answer = await python.globals.get("run_cell")(code.innerText);
  const [text, html, pictures] = answer.toJs();
  output.appendChild(document.createElement("pre")).textContent = text;
  if (html) output.appendChild(document.createElement("div")).innerHTML = html;
  for (const svg of pictures) {
    const picture = output.appendChild(new Image());
    picture.src = `data:image/svg+xml,${encodeURIComponent(svg)}`;
  }
  button.disabled = false;
}
