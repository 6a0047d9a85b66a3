// Keyboard shortcuts of the player.

export function press(player, event) {
  const isTyping = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea, dialog");
  if (isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  const { step } = player.scene.at(player.clock.time);
  const isButton = event.target.closest("button, summary, a, input");
  const pan = (dx, dy) => { player.stage.camera.pan(dx, dy); player.stage.follows = false; player.stage.moved(); };
  const zoom = (factor) => { player.stage.camera.zoom(factor); player.stage.moved(); };
  const moves = {
    ArrowLeft: () => (event.shiftKey ? pan(60, 0) : player.goTo(step - 1)),
    ArrowRight: () => (event.shiftKey ? pan(-60, 0) : player.goTo(step + 1)),
    ArrowUp: () => event.shiftKey && pan(0, 60),
    ArrowDown: () => event.shiftKey && pan(0, -60),
    Home: () => player.goTo(0),
    End: () => player.goTo(player.scene.numSteps - 1),
    "+": () => zoom(1.25),
    "=": () => zoom(1.25),
    "-": () => zoom(0.8),
    0: () => player.stage.fitRoute(),
    f: () => player.follow(!player.stage.follows),
    v: () => player.look(player.isInSpace ? "" : "3d"),
    p: () => document.querySelector("#player .beside [rel=prev]")?.click(),
    n: () => document.querySelector("#player .beside [rel=next]")?.click(),
    c: () => player.toggleCamera(),
    Escape: () => player.onEnd(),
  };
  if (!isButton) moves[" "] = () => player.toggle();
  if (!(event.key in moves) || (event.key.startsWith("Arrow") && isButton && event.target.type !== "range")) return;
  if (moves[event.key]() !== false) event.preventDefault();
}
