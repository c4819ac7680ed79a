"use strict";
// Opens a pair's viewer. Programs and data lie beside the page and are loaded when they are first asked for, as classic
// scripts: a page that was opened from a path may not fetch.
const fmqmViewer = (() => {
  const PATH = /^viewer\/[A-Za-z0-9-]+\.js$/;
  const loading = new Map(); // promises by path
  const taken = new Map(); // data by path

  function load(path) {
    if (!PATH.test(path)) return Promise.reject(new Error("no file of this page"));
    if (!loading.has(path)) {
      loading.set(
        path,
        new Promise((done, fail) => {
          const script = document.createElement("script");
          script.src = path;
          script.onload = () => done(taken.get(path));
          script.onerror = () => fail(new Error(`${path} is not there`));
          document.head.append(script);
          script.remove();
        }).catch((error) => {
          loading.delete(path);
          throw error;
        }),
      );
    }
    return loading.get(path);
  }

  async function open(place) {
    const said = place.querySelector(".viewer-said");
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2", { antialias: true });
    if (!context || typeof DecompressionStream === "undefined") {
      said.textContent = "This browser cannot draw in 3D here (no WebGL 2); the pictures show the same.";
      return;
    }
    said.textContent = "Loading …";
    try {
      await load("viewer/three.js");
      await load("viewer/viewer.js");
      const [reference, level] = await Promise.all([load(place.dataset.reference), load(place.dataset.level)]);
      await fmqmViewer.show(place, canvas, context, reference, level);
      said.textContent = "";
    } catch (error) {
      said.textContent = `The viewer cannot be opened: ${error.message}.`;
    }
  }

  if (typeof WebGL2RenderingContext !== "undefined") document.documentElement.classList.add("has-viewer");
  document.addEventListener("click", (event) => {
    const button = event.target.closest(".viewer-open");
    if (button) open(button.closest(".viewer"));
  });
  // The page closes what holds it.
  document.addEventListener("fmqm-close", (event) => event.target.querySelector(".viewer-shown .viewer-close")?.click(), true);

  return {
    ramp: "RAMP",
    open,
    take: (path, data) => taken.set(path, data),
    // What was loaded of a pair is let go; it is loaded again when it is asked for.
    drop: (path) => [loading, taken].forEach((each) => each.delete(path)),
  };
})();
