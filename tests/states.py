"""States of live pages, and what `solve` says of the motion that a page claims in each."""

import numpy as np

import actionopt as ao
from actionopt.plot.live.page import SCRIPTS, STATIC, figure
from actionopt.tools.document import document

# Each slider at `count` places, from a fresh start, then Solve.
VISIT = """
(async () => {
  const figure = document.querySelector(".live"), live = figure.live, found = [];
  const sliders = [...figure.querySelectorAll("input[data-duration], input[data-parameter]")];
  const press = (name) => figure.querySelector(`[data-do=${name}]`).click();
  for (const input of sliders)
    for (let k = 0; k < COUNT; k++) {
      press("restart");
      const low = Number(input.min), high = Number(input.max);
      input.value = low + ((k + SHIFT) / COUNT) * (high - low);
      for (const kind of ["input", "change"]) input.dispatchEvent(new Event(kind));
      press("solve");
      const A = live.A, { action, last, kind, index } = figure.dataset;
      found.push({
        slider: input.dataset.parameter ?? "T", value: Number(input.value), known: live.known(),
        action: Number(action), last: Number(last), kind, index,
        message: figure.querySelector(".message").textContent,
        T: A.duration, p: [...A.p], ends: A.ends,
        Q: Array.from({ length: 401 }, (_, j) => [...A.sample(live.motion(), j / 400)]),
      });
      await new Promise((r) => setTimeout(r));
    }
  return found;
})()
"""


def states(browser, file, count, shift=0.5):
    """Return what the page of a file claims in each of its states."""
    browser.open(file, still=True)
    return browser.run(VISIT.replace("COUNT", str(count)).replace("SHIFT", str(shift)))


def write(question, solution, file):
    """Write a page with the live figure of a solution alone."""
    style, *scripts = ((STATIC / x).read_text(encoding="utf-8") for x in ("style.css", *SCRIPTS))
    code = "".join(f"<script>{text}</script>" for text in scripts)
    body = f"<main>{figure(question, solution)}</main>{code}"
    file.write_text(document("live", f"<style>{style}</style>", body), encoding="utf-8")


def at(problem, state):
    """Return the question of a state: other parameters, another end."""
    table, place, values = problem.system.table, 0, {}
    for name, value in table.values(problem.parameters).items():
        size = np.size(value)
        values[name] = np.reshape(state["p"][place : place + size], np.shape(value))
        place += size
    t = problem.start.t
    # The page moves an end along a motion that it knows to ten digits: less than that is none.
    ends = [
        np.where(np.abs(q) < 1e-10 * np.abs(q).max(), 0.0, q) for q in map(np.array, state["ends"])
    ]
    start, end = (ao.Event(t + by, q) for by, q in zip((0, state["T"]), ends, strict=True))
    return ao.Problem(problem.system, start, end, parameters=values)


def judge(problem, state):
    """Return "agrees", "unknown" or what is wrong with what a page says in a state."""
    if not state["known"]:
        claims = state["kind"] not in ("coarse", "none") or "zero in every" in state["message"]
        return "claims what it does not know" if claims else "unknown"
    asked = at(problem, state)
    solution = ao.solve(asked, guess=np.transpose(state["Q"]), tol=1e-9, throw=False)
    if not solution.success and state["kind"] not in ("degenerate", "undecided"):
        return f"no motion: {solution.status} S = {solution.action}"
    if abs(solution.action - state["action"]) > state["last"]:
        return f"S = {state['action']}, not {solution.action}"
    sure = state["kind"] in ("minimum", "saddle")
    if sure and int(state["index"]) != solution.morse_index:
        return f"index {state['index']}, not {solution.morse_index}"
    return "agrees"
