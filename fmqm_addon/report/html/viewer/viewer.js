"use strict";
// The viewer of a pair: panes, a wipe, what can be chosen, and the worst places. One is open at a time.
fmqmViewer.show = (() => {
  const SURFACES = ["Original", "LOD"];
  const SIDE_BY_SIDE = "Side by Side", WIPE = "Wipe";
  const LIGHTS = ["Headlight", "Unlit"];
  const NARROW = "(max-width: 46rem)";
  const VIEWS = [...SURFACES, ...SURFACES.map((name) => `Heat Map on ${name}`)];
  const chosen = { wipe: [0, 1], layout: null, light: LIGHTS[0], wire: false, pins: true, on: 0, layer: null };
  const REST = 100; // milliseconds
  let close = () => {};

  function element(kind, properties = {}, ...children) {
    const made = Object.assign(document.createElement(kind), properties);
    made.append(...children);
    return made;
  }

  function select(label, options, value, changed) {
    const made = element("select", {}, ...options.map(([key, text]) => element("option", { value: key, textContent: text })));
    made.value = value;
    made.addEventListener("change", () => changed(made.value));
    return element("label", {}, element("span", { textContent: label }), made);
  }

  function check(label, value, changed) {
    const made = element("input", { type: "checkbox", checked: value });
    made.addEventListener("change", () => changed(made.checked));
    return element("label", { className: "viewer-check" }, made, element("span", { textContent: label }));
  }

  function number(value) {
    if (value !== 0 && Math.abs(value) < 1e-4) return value.toExponential(1);
    return value.toLocaleString("en", { maximumSignificantDigits: 3 });
  }

  async function show(place, canvas, context, reference, level) {
    close();
    const pair = await fmqmViewer.scene.pairOf(reference, level);
    const { layers, worst } = level.heat;
    const triangles = [reference.mesh.triangles, level.mesh.triangles].map((count) => `${count.toLocaleString("en")} triangles`);
    chosen.layout ??= matchMedia(NARROW).matches ? WIPE : SIDE_BY_SIDE;
    if (!layers.some((layer) => layer.name === chosen.layer)) chosen.layer = level.judge;
    let wipe = 0.5;

    const renderer = new THREE.WebGLRenderer({ canvas, context, antialias: true, alpha: true });
    renderer.setClearAlpha(0);
    renderer.setScissorTest(true);

    const stage = element("div", { className: "viewer-stage", tabIndex: 0 });
    stage.setAttribute("role", "application");
    stage.setAttribute(
      "aria-label",
      "3D view. Arrow keys turn it, plus and minus come nearer and go away, 0 shows all.",
    );
    const panes = element("div", { className: "viewer-panes" });
    const pins = element("div", { className: "viewer-pins" });
    pins.setAttribute("aria-hidden", "true"); // the buttons below do the same
    const handle = element("div", { className: "viewer-handle" });
    const slider = element("input", { type: "range", min: 0, max: 100, step: 1, value: 50, className: "viewer-slider" });
    slider.setAttribute("aria-label", "Wipe");
    stage.append(canvas, panes, pins, handle);
    const legend = element("div", { className: "viewer-legend" });
    const sides = element("div", { className: "viewer-choices viewer-sides" });
    const view = fmqmViewer.camera.cameraOf(stage, pair, level.side, later);

    // What is drawn: places on the stage, each with what it shows.
    function shown() {
      const whole = stage.getBoundingClientRect();
      if (chosen.layout === WIPE) {
        return chosen.wipe.map((which, side) => ({
          pane: whole, which, from: side ? wipe : 0, to: side ? 1 : wipe, whole,
        }));
      }
      return [0, 1, 2 + chosen.on].map((which, k) => ({
        pane: panes.children[k].getBoundingClientRect(), which, from: 0, to: 1, whole,
      }));
    }

    let waiting = 0, resting = 0;
    function later() {
      waiting ||= requestAnimationFrame(() => {
        waiting = 0;
        draw();
      });
    }

    function draw() {
      const { clientWidth: width, clientHeight: height } = stage;
      if (!width || !height) return;
      const ratio = Math.min(devicePixelRatio, 2);
      if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
        renderer.setPixelRatio(ratio);
        renderer.setSize(width, height, false);
      }
      const drawn = shown();
      for (const { pane, which, from, to, whole } of drawn) {
        const left = pane.left - whole.left, bottom = whole.bottom - pane.bottom;
        view.shape(pane.width, pane.height);
        pair.choose(which % 2, which >= 2, chosen.wire);
        renderer.setViewport(left, bottom, pane.width, pane.height);
        renderer.setScissor(left + from * pane.width, bottom, (to - from) * pane.width, pane.height);
        renderer.render(pair.scene, view.camera);
      }
      placePins(drawn);
      clearTimeout(resting);
      resting = setTimeout(dimPins, REST);
    }

    // Those that the original hides; it is looked through once nothing moves.
    function dimPins() {
      const eye = view.camera.position;
      const hidden = worst.map((each) => pair.hides(eye, new THREE.Vector3(...each.at)));
      for (const pin of pins.children) pin.classList.toggle("viewer-behind", hidden[pin.dataset.rank]);
    }

    function placePins(drawn) {
      const panesOnce = chosen.layout === WIPE ? drawn.slice(0, 1) : drawn;
      const needed = chosen.pins ? panesOnce.length * worst.length : 0;
      while (pins.children.length > needed) pins.lastChild.remove();
      while (pins.children.length < needed) {
        pins.append(element("button", { type: "button", tabIndex: -1, className: "viewer-pin" }));
      }
      if (!needed) return;
      panesOnce.forEach(({ pane, whole }, k) => {
        view.shape(pane.width, pane.height);
        view.camera.updateMatrixWorld();
        worst.forEach((each, rank) => {
          const pin = pins.children[k * worst.length + rank];
          const at = new THREE.Vector3(...each.at);
          const { x, y, z } = at.project(view.camera);
          pin.textContent = rank + 1;
          pin.dataset.rank = rank;
          pin.hidden = Math.abs(x) > 1 || Math.abs(y) > 1 || Math.abs(z) > 1;
          pin.style.left = `${pane.left - whole.left + ((x + 1) / 2) * pane.width}px`;
          pin.style.top = `${pane.top - whole.top + ((1 - y) / 2) * pane.height}px`;
        });
      });
    }

    function arrange() {
      const wiping = chosen.layout === WIPE;
      const titles = wiping ? chosen.wipe.map((which) => VIEWS[which]) : [...SURFACES, VIEWS[2 + chosen.on]];
      panes.replaceChildren(
        ...titles.map((title, k) =>
          element(
            "div",
            { className: "viewer-pane" },
            element("span", { className: "viewer-title" }, element("strong", { textContent: title }), wiping || k > 1 ? "" : ` ${triangles[k]}`),
          ),
        ),
      );
      stage.classList.toggle("viewer-wiping", wiping);
      handle.hidden = slider.hidden = sides.hidden = !wiping;
      slid();
    }

    function slid() {
      handle.style.left = `${100 * wipe}%`;
      slider.value = 100 * wipe;
      later();
    }

    function paint() {
      const layer = layers.find((each) => each.name === chosen.layer);
      pair.layer(layer);
      const ramp = layer.values ? fmqmViewer.ramp : [...fmqmViewer.ramp].reverse();
      const bar = element("span", { className: "viewer-ramp" });
      bar.style.background = `linear-gradient(90deg, ${ramp.join(",")})`;
      legend.replaceChildren(
        element("span", { textContent: layer.label }),
        element(
          "span",
          { className: "viewer-scale" },
          element("span", { textContent: (layer.values && layer.low > 0 ? "≤ " : "") + number(layer.low) }),
          bar,
          element("span", { textContent: number(layer.high) + (layer.name === "SDF_DIFFERENCE" ? " scene units" : "") }),
        ),
        level.heat.partial ? element("span", { textContent: "dimmed: not measured" }) : "",
      );
      later();
    }

    handle.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      handle.setPointerCapture(event.pointerId);
    });
    handle.addEventListener("pointermove", (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const { left, width } = stage.getBoundingClientRect();
      wipe = Math.min(Math.max((event.clientX - left) / width, 0), 1);
      slid();
    });
    slider.addEventListener("input", () => {
      wipe = slider.value / 100;
      slid();
    });
    pins.addEventListener("click", (event) => {
      const pin = event.target.closest(".viewer-pin");
      if (pin) view.flyTo(worst[pin.dataset.rank]);
    });

    const button = (text, clicked) => {
      const made = element("button", { type: "button", textContent: text });
      made.addEventListener("click", clicked);
      return made;
    };
    const closing = button("Close", () => {
      close();
      place.querySelector(".viewer-open").focus();
    });
    closing.className = "viewer-close";
    const named = (names) => names.map((name) => [name, name]);
    const numbered = (names) => names.map((name, k) => [k, name]);
    const choices = element(
      "div",
      { className: "viewer-choices" },
      select("View", named([SIDE_BY_SIDE, WIPE]), chosen.layout, (value) => {
        chosen.layout = value;
        arrange();
        fit();
      }),
      select("Heat Map", layers.map(({ name, label }) => [name, label]), chosen.layer, (value) => {
        chosen.layer = value;
        paint();
      }),
      select("Show On", numbered(SURFACES), chosen.on, (value) => {
        chosen.on = Number(value);
        arrange();
      }),
      select("Light", named(LIGHTS), chosen.light, (value) => {
        chosen.light = value;
        pair.light(value === LIGHTS[0]);
        later();
      }),
      check("Wireframe", chosen.wire, (value) => {
        chosen.wire = value;
        later();
      }),
      check("Pins", chosen.pins, (value) => {
        chosen.pins = value;
        later();
      }),
      button("Reset View", () => view.reset()),
      ...(document.fullscreenEnabled ? [button("Full Screen", () => full())] : []),
      closing,
    );
    sides.append(
      ...["Left", "Right"].map((label, side) =>
        select(label, numbered(VIEWS), chosen.wipe[side], (value) => {
          chosen.wipe[side] = Number(value);
          arrange();
        }),
      ),
    );
    const places = element(
      "ol",
      { className: "viewer-places" },
      ...worst.map((each, rank) => {
        const fly = button("", () => view.flyTo(each));
        fly.append(
          element("strong", { textContent: rank + 1 }),
          ` ${level.judge} ${each.words}`,
        );
        return element("li", {}, fly);
      }),
    );
    places.setAttribute("aria-label", "Worst places");
    const full = () => (document.fullscreenElement ? document.exitFullscreen() : body.requestFullscreen());
    const body = element("div", { className: "viewer-body" }, choices, sides, stage, slider, legend, places);
    place.append(body);
    place.classList.add("viewer-shown");

    const fit = () => {
      const { clientWidth, clientHeight } = chosen.layout === WIPE ? stage : panes.firstChild;
      if (clientWidth && clientHeight) view.fit(clientWidth, clientHeight);
      later();
    };
    const resized = new ResizeObserver(fit);
    close = () => {
      close = () => {};
      if (document.fullscreenElement === body) document.exitFullscreen();
      resized.disconnect();
      cancelAnimationFrame(waiting);
      clearTimeout(resting);
      view.dispose();
      pair.dispose();
      renderer.dispose();
      context.getExtension("WEBGL_lose_context")?.loseContext();
      body.remove();
      place.classList.remove("viewer-shown");
      fmqmViewer.drop(place.dataset.level);
      fmqmViewer.drop(place.dataset.reference);
    };
    pair.light(chosen.light === LIGHTS[0]);
    arrange();
    fit();
    paint();
    resized.observe(stage);
    draw();
    stage.focus({ preventScroll: true });
  }

  return show;
})();
