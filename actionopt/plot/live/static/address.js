// What its reader did on a page, in the address behind the #: a link hands it on.
globalThis.actionopt ??= {};
globalThis.actionopt.address = (() => {
  "use strict";
  const PATIENCE = 300; // milliseconds without a change before it is written
  const read = () => new URLSearchParams(location.hash.slice(1));
  const wanted = new Map();
  let waiting = null;
  const write = () => {
    const all = read();
    for (const [key, value] of wanted) if (value === null) all.delete(key); else all.set(key, value);
    wanted.clear();
    const text = all.toString();
    if (text !== location.hash.slice(1)) history.replaceState(history.state, "", text ? `#${text}` : location.pathname + location.search);
  };
  return {
    get: (key) => (wanted.has(key) ? wanted.get(key) : read().get(key)),
    set(key, value) { // null takes it out
      wanted.set(key, value);
      clearTimeout(waiting);
      waiting = setTimeout(write, PATIENCE);
    },
    // Numbers in few letters, to seven digits.
    packed: (rows) => btoa(String.fromCharCode(...new Uint8Array(Float32Array.from(rows).buffer))).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, ""),
    numbers: (text) => new Float32Array(Uint8Array.from(atob(text.replace(/-/g, "+").replace(/_/g, "/")), (x) => x.charCodeAt(0)).buffer),
  };
})();
