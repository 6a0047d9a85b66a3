// Controls of the player: play, step, slider, speed and layers below the canvas; zoom and follow on it.

import { make } from "/static/elements.js";

const speeds = [0.25, 0.5, 1, 2, 4];

export function controls(player, layers, hasSpace) {
  const { scene, clock } = player;
  const last = scene.numSteps - 1;
  const play = make("button", { type: "button", class: "primary play", onclick: () => player.toggle() }, "Play");
  const slider = make("input", { type: "range", min: 0, max: last, value: scene.now, step: 1, "aria-label": "Timestep", disabled: last === 0 });
  slider.addEventListener("input", () => player.goTo(Number(slider.value)));
  const seconds = make("span");
  const steps = make("span", { class: "step" });
  const time = make("output", { class: "time" }, seconds, steps);
  const speed = make("select", { "aria-label": "Speed" }, ...speeds.map((value) => make("option", { value, selected: value === 1 }, `${value}×`)));
  speed.addEventListener("change", () => { clock.speed = Number(speed.value); });
  const step = (label, by, words) => make("button", { type: "button", "aria-label": words, onclick: () => player.goTo(scene.at(clock.time).step + by) }, label);
  const bar = make(
    "div", { class: "controls" },
    make("div", { class: "row" }, play, step("−1", -1, "One step back"), step("+1", 1, "One step forward"), slider, time, speed, make("button", { type: "button", onclick: () => player.askClip() }, "Clip…")),
    make("fieldset", { class: "layers" }, make("legend", {}, "Layers"), ...Object.keys(layers).map((name) => layer(player, layers, name))),
  );
  const view = viewButtons(player, hasSpace);
  const update = () => {
    const now = scene.at(clock.time).step;
    play.textContent = clock.isRunning ? "Pause" : "Play";
    slider.value = now;
    slider.setAttribute("aria-valuetext", `${clock.time.toFixed(1)} seconds`);
    seconds.textContent = `${clock.time.toFixed(1)} / ${clock.duration.toFixed(1)} s`;
    steps.textContent = ` · step ${now} of ${last}`;
    view.follow.setAttribute("aria-pressed", String(player.stage?.follows ?? false));
    view.space.setAttribute("aria-pressed", String(player.isInSpace ?? false));
    view.camera.setAttribute("aria-pressed", String(Boolean(player.camera.view)));
  };
  play.disabled = last === 0;
  update();
  return { bar, view: view.element, update };
}

function layer(player, layers, name) {
  const box = make("input", { type: "checkbox", checked: layers[name] });
  box.addEventListener("change", () => {
    layers[name] = box.checked;
    player.stage.redrawMap();
  });
  return make("label", {}, box, name);
}

function viewButtons(player, hasSpace) {
  const zoom = (factor) => { player.stage.camera.zoom(factor); player.stage.moved(); };
  const button = (label, words, action) => make("button", { type: "button", "aria-label": words, title: words, onclick: action }, label);
  const follow = button("Follow", "Follow the selected object or the ego (F)", () => player.follow(!player.stage.follows));
  const words3d = hasSpace ? "Show the scenario in space (V)" : "This browser has no WebGL 2, which the view in space needs";
  const space = button("3-D", words3d, () => player.look(player.isInSpace ? "" : "3d"));
  space.disabled = !hasSpace;
  const camera = button("Camera", "Show what a camera sees from the selected object or the ego (C)", () => player.toggleCamera());
  const element = make(
    "div", { class: "view" },
    button("+", "Zoom in (+)", () => zoom(1.4)),
    button("−", "Zoom out (-)", () => zoom(1 / 1.4)),
    button("Route", "Show the ego's route (0)", () => player.stage.fitRoute()),
    button("All", "Show the whole scenario", () => player.stage.fitAll()),
    follow,
    space,
    camera,
  );
  return { element, follow, space, camera };
}
