// Sections of a page as tabs, one seen at a time: in print, and without scripts, all of them are.
(() => {
  "use strict";
  const { address } = globalThis.actionopt;
  document.querySelectorAll("[data-tabs]").forEach((box) => {
    const panels = [...box.children].filter((x) => x.matches("section")), list = document.createElement("div");
    const tabs = panels.map((panel, k) => {
      const tab = document.createElement("button"), heading = panel.querySelector("[data-tab]");
      panel.id ||= `part-${k + 1}`;
      tab.textContent = heading.dataset.tab;
      for (const [name, value] of Object.entries({ type: "button", role: "tab", id: `tab-${k + 1}`, "aria-controls": panel.id })) tab.setAttribute(name, value);
      for (const [name, value] of Object.entries({ role: "tabpanel", "aria-labelledby": tab.id, tabindex: 0 })) panel.setAttribute(name, value);
      tab.addEventListener("click", () => choose(k));
      tab.addEventListener("keydown", (event) => {
        const to = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: panels.length - 1 }[event.key];
        if (to === undefined) return;
        event.preventDefault();
        choose((to + panels.length) % panels.length);
        tabs[(to + panels.length) % panels.length].focus();
      });
      list.append(tab);
      return tab;
    });
    list.className = "tabs";
    list.setAttribute("role", "tablist");
    list.setAttribute("aria-label", box.dataset.tabs);
    box.prepend(list);
    box.classList.add("tabbed");
    function show(at) {
      tabs.forEach((tab, k) => {
        tab.setAttribute("aria-selected", k === at);
        tab.tabIndex = k === at ? 0 : -1;
        panels[k].classList.toggle("unseen", k !== at);
      });
    }
    function choose(at) {
      show(at);
      address.set("part", at ? panels[at].id : null);
    }
    show(Math.max(0, panels.findIndex((panel) => address.get("part") === panel.id)));
  });
})();
