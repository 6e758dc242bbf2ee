// The probe: a ring over the picture that is dragged in the plane through it that faces the viewer. The server is asked
// again only when it has answered, so that it never falls behind.
"use strict";
(() => {
  const STEP = 0.01; // of a key, in diagonals of the surface
  let point = null, grip = null, busy = false, waiting = null, first = null;

  const add = (a, b, s = 1) => a.map((v, k) => v + s * b[k]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((v) => v / Math.sqrt(dot(a, a)));

  // Right, up and away from the viewer, and half the height of what is seen at the depth of a point.
  function frame(camera, at) {
    const away = unit(add(camera.focalPoint, camera.position, -1));
    const right = unit(cross(away, camera.viewUp));
    const depth = dot(add(at, camera.position, -1), away);
    const half = camera.parallelProjection ? camera.parallelScale : depth * Math.tan((camera.viewAngle * Math.PI) / 360);
    return { away, right, up: cross(right, away), depth, half };
  }

  async function tell(local, settled) {
    waiting = [local, settled];
    if (busy) return;
    busy = true;
    try {
      while (waiting) {
        const [at, still] = waiting;
        waiting = null;
        await trame.trigger("probe", [at, still]);
      }
    } finally {
      busy = false;
    }
  }

  function follow() {
    requestAnimationFrame(follow);
    const view = window.trame && trame.refs && trame.refs.view, ring = document.getElementById("vk-probe");
    if (!view || !ring) return;
    const camera = view.getCamera();
    if (!camera) return;
    if (!ring.dataset.ready) prepare(ring, view);
    if (!grip && !busy) point = trame.state.get("probe");
    if (!point) return;
    const box = ring.parentElement.getBoundingClientRect(), seen = frame(camera, point);
    const from = add(point, camera.position, -1), scale = box.height / (2 * seen.half);
    ring.hidden = !(seen.depth > 0);
    ring.style.left = `${box.width / 2 + scale * dot(from, seen.right)}px`;
    ring.style.top = `${box.height / 2 - scale * dot(from, seen.up)}px`;
  }

  function prepare(ring, view) {
    ring.dataset.ready = "yes";
    const move = (right, up, away, settled) => {
      const seen = frame(view.getCamera(), point);
      point = add(add(add(point, seen.right, right), seen.up, up), seen.away, away);
      tell(point, settled);
    };
    ring.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      event.stopPropagation();
      ring.focus();
      ring.setPointerCapture(event.pointerId);
      grip = [event.clientX, event.clientY];
    });
    ring.addEventListener("pointermove", (event) => {
      if (!grip) return;
      event.stopPropagation();
      const unitsPerPixel = (2 * frame(view.getCamera(), point).half) / ring.parentElement.clientHeight;
      const right = unitsPerPixel * (event.clientX - grip[0]), up = unitsPerPixel * (grip[1] - event.clientY);
      grip = [event.clientX, event.clientY];
      if (event.shiftKey) move(0, 0, up, false);
      else move(right, up, 0, false);
    });
    const release = (event) => {
      if (!grip) return;
      event.stopPropagation();
      grip = null;
      tell(point, true);
    };
    ring.addEventListener("pointerup", release);
    ring.addEventListener("pointercancel", release);
    ring.addEventListener("keydown", (event) => {
      const ways = {
        ArrowLeft: [-STEP, 0, 0], ArrowRight: [STEP, 0, 0], ArrowUp: [0, STEP, 0], ArrowDown: [0, -STEP, 0],
        PageUp: [0, 0, STEP], PageDown: [0, 0, -STEP],
      };
      if (!(event.key in ways)) return;
      event.preventDefault();
      event.stopPropagation();
      move(...ways[event.key], true);
    });
    first = structuredClone(view.getCamera()); // its arrays are those of the camera
    document.getElementById("vk-reset").addEventListener("click", () => view.setCamera(structuredClone(first)));
    document.documentElement.dataset.ready = "yes";
    trame.trigger("begin");
  }

  requestAnimationFrame(follow);
})();
