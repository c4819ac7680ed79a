"use strict";
// Where one looks from: turned by mouse, touch and keys, and flown to places. Z is up, as in Blender.
fmqmViewer.camera = (() => {
  const FIELD_OF_VIEW = 24; // degrees, from top to bottom
  const MARGIN = 1.08;
  const TURN = Math.PI / 24; // for a press of an arrow
  const ZOOM = 1.15; // for a press of + or -
  const FLIGHT = 500; // milliseconds
  const MOST_POINTS = 20000; // that are looked at to find the distance from which all is seen
  const SURROUNDINGS = 1.25; // patch diagonals to either side of a place that is flown to
  const STEEPEST = Math.PI / 2 - 0.01;

  // Angles and distance of what lies around a target, and back.
  function polar(offset) {
    const radius = offset.length();
    return { azimuth: Math.atan2(offset.x, -offset.y), elevation: Math.asin(offset.z / radius), radius };
  }
  function cartesian({ azimuth, elevation, radius }) {
    const level = radius * Math.cos(elevation);
    return new THREE.Vector3(level * Math.sin(azimuth), -level * Math.cos(azimuth), radius * Math.sin(elevation));
  }

  // element: where it is turned. box, points: of what is to be seen. side: from which, in degrees from the front (-Y) to
  // the right, and up. changed: called whenever the view is another.
  function cameraOf(element, { box, points }, side, changed) {
    const camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW);
    camera.up.set(0, 0, 1);
    const controls = new THREE.OrbitControls(camera, element);
    controls.minDistance = 0.005;
    const middle = box.min.clone().add(box.max).multiplyScalar(0.5);
    const reach = box.max.distanceTo(box.min);
    controls.maxDistance = 20 * reach;
    let flight = 0;
    let aspect = 1;
    let whole = true; // all is in view, as at first: it stays so when panes change
    function stop() {
      cancelAnimationFrame(flight);
      whole = false;
    }
    controls.addEventListener("change", changed);
    controls.addEventListener("start", stop);

    function look(target, place) {
      controls.target.copy(target);
      camera.position.copy(target).add(cartesian(place));
      controls.update();
      changed();
    }

    function fly(target, place) {
      stop();
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) return look(target, place);
      const from = controls.target.clone();
      const start = polar(camera.position.clone().sub(from));
      let turn = (place.azimuth - start.azimuth) % (2 * Math.PI);
      if (Math.abs(turn) > Math.PI) turn -= 2 * Math.PI * Math.sign(turn);
      const began = performance.now();
      function step(now) {
        const share = Math.min(Math.max((now - began) / FLIGHT, 0), 1);
        const eased = share * share * (3 - 2 * share);
        look(from.clone().lerp(target, eased), {
          azimuth: start.azimuth + eased * turn,
          elevation: start.elevation + eased * (place.elevation - start.elevation),
          radius: start.radius * (place.radius / start.radius) ** eased,
        });
        if (share < 1) flight = requestAnimationFrame(step);
      }
      flight = requestAnimationFrame(step);
    }

    // The distance from which what lies so far to the side and above is seen.
    function distanceFor(aside, above) {
      const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
      return (MARGIN / slope) * Math.max(above, aside / aspect);
    }

    function home() {
      const place = { azimuth: (side[0] * Math.PI) / 180, elevation: (side[1] * Math.PI) / 180, radius: 1 };
      const back = cartesian(place);
      const right = new THREE.Vector3(0, 0, 1).cross(back).normalize();
      const up = back.clone().cross(right);
      const at = new THREE.Vector3();
      place.radius = 0.05;
      for (const positions of points) {
        const step = 3 * Math.ceil(positions.length / 3 / MOST_POINTS);
        for (let k = 0; k < positions.length; k += step) {
          at.fromArray(positions, k).sub(middle);
          const needed = at.dot(back) + distanceFor(Math.abs(at.dot(right)), Math.abs(at.dot(up)));
          place.radius = Math.max(place.radius, needed);
        }
      }
      return [middle, place];
    }

    // A place from straight in front of it, with its surroundings.
    function flyTo({ center, normal, diagonal }) {
      const out = new THREE.Vector3(...normal);
      const place = out.length() > 0 ? polar(out) : home()[1];
      place.elevation = Math.min(Math.max(place.elevation, -STEEPEST), STEEPEST);
      // Never from farther away than all of it is seen from.
      place.radius = Math.min(distanceFor(SURROUNDINGS * diagonal, SURROUNDINGS * diagonal), home()[1].radius);
      fly(new THREE.Vector3(...center), place);
    }

    function turn(azimuth, elevation, zoom) {
      const place = polar(camera.position.clone().sub(controls.target));
      place.azimuth += azimuth;
      place.elevation = Math.min(Math.max(place.elevation + elevation, -STEEPEST), STEEPEST);
      place.radius = Math.min(Math.max(place.radius * zoom, controls.minDistance), controls.maxDistance);
      look(controls.target.clone(), place);
    }

    function reset() {
      fly(...home());
      whole = true;
    }

    const keys = {
      ArrowLeft: () => turn(-TURN, 0, 1),
      ArrowRight: () => turn(TURN, 0, 1),
      ArrowUp: () => turn(0, TURN, 1),
      ArrowDown: () => turn(0, -TURN, 1),
      "+": () => turn(0, 0, 1 / ZOOM),
      "=": () => turn(0, 0, 1 / ZOOM),
      "-": () => turn(0, 0, ZOOM),
      0: () => reset(),
    };
    element.addEventListener("keydown", (event) => {
      if (!Object.hasOwn(keys, event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      stop();
      keys[event.key]();
    });

    return {
      camera,
      flyTo,
      reset,
      // For a pane of so many pixels, when panes have changed.
      fit(width, height) {
        aspect = width / height;
        controls.zoomToCursor = width === element.clientWidth && height === element.clientHeight; // it knows of no panes
        if (whole) look(...home());
      },
      // For a pane of so many pixels, before it is drawn.
      shape(width, height) {
        const distance = camera.position.distanceTo(middle);
        camera.aspect = width / height;
        camera.far = distance + reach;
        camera.near = Math.max(distance - reach, camera.far / 2000);
        camera.updateProjectionMatrix();
      },
      dispose() {
        cancelAnimationFrame(flight);
        controls.dispose();
      },
    };
  }

  return { cameraOf };
})();
