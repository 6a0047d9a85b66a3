// The player's view in space: the map flat on the ground, objects as shapes; the pointer turns the view around a point.

import { Orbit } from "/static/orbit.js";
import { Pointers } from "/static/pointers.js";
import { bytes, groundOf, runMesh } from "/static/space_ground.js";
import { SpaceObjects } from "/static/space_objects.js";
import { shapes } from "/static/space_shapes.js";
import { View } from "/static/view.js";
import { GroundBuffer, programs, ShapeBuffer } from "/static/webgl.js";

const farthest = 4000; // [m] half a side of the ground
const runWidth = 0.5; // [m]

let isAble = null;

// Whether this browser draws in space.
export function hasSpace() {
  if (isAble === null) {
    const gl = document.createElement("canvas").getContext("webgl2");
    isAble = Boolean(gl);
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
  }
  return isAble;
}

export class Space extends View {
  constructor(canvas, scene, style, layers, clock, runs) {
    super(canvas, scene, style, layers, clock, new Orbit());
    this.runs = runs;
    this.gl = canvas.getContext("webgl2", { stencil: true, antialias: true, alpha: false });
    this.objects = new SpaceObjects(scene, style, runs);
    this.ground = groundOf(scene, style);
    this.sky = bytes(style.sky).map((value) => value / 255);
    this.prepare();
    this.listen();
    this.resize();
    const { heading } = scene.place(scene.ego, scene.at(clock.time), {});
    if (heading !== undefined) this.camera.azimuth = heading + Math.PI + 0.5; // behind the ego, beside its path
    this.fitRoute();
  }

  // Move everything to the graphics card; again after it was lost.
  prepare() {
    const { gl } = this;
    this.programs = programs(gl);
    this.layersDrawn = Object.fromEntries(Object.entries(this.ground).map(([name, mesh]) => [name, new GroundBuffer(gl, mesh)]));
    const around = (color) => {
      const points = [-1, -1, 1, -1, 1, 1, -1, 1].map((side) => side * farthest);
      return new GroundBuffer(gl, { points: [0, 2, 4, 6].flatMap((k) => [points[k], points[k + 1], -1e9]), colors: [0, 0, 0, 0].flatMap(() => bytes(color)), corners: [0, 1, 2, 0, 2, 3] });
    };
    this.everywhere = { ground: around(this.style.ground), road: around(this.style.road) };
    this.shapes = Object.fromEntries(Object.entries(shapes()).map(([name, corners]) => [name, new ShapeBuffer(gl, corners)]));
    this.paths = new Map(); // of runs
    this.isStale = true;
  }

  close() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  // Follow the selected object or the ego, or stop.
  follow(isFollowed) {
    this.follows = isFollowed;
    if (isFollowed) this.camera.distance = Math.min(this.camera.distance, 45);
    this.moved();
  }

  // Paint if something has changed.
  paint(now, isForced) {
    if (!this.isStale && !isForced) return;
    this.isStale = false;
    const { gl, camera, clock, layers } = this;
    const moment = this.scene.at(clock.time);
    if (this.follows) this.center(moment);
    this.objects.update(layers, moment, clock.time);
    const view = { matrix: camera.matrix(), eye: camera.frame.eye };
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(this.sky[0], this.sky[1], this.sky[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST); // the ground is painted in order, below everything else
    this.use(this.programs.ground, view);
    this.paintGround();
    this.use(this.programs.shape, view);
    this.shapes.flat.draw(gl, this.objects.shadows.values, this.objects.shadows.count);
    gl.enable(gl.DEPTH_TEST);
    for (const [name, instances] of Object.entries(this.objects.solid)) this.shapes[name].draw(gl, instances.values, instances.count);
  }

  use({ program, uniforms }, { matrix, eye }) {
    const { gl } = this;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.matrix, false, matrix);
    gl.uniform3fv(uniforms.eye, eye);
    gl.uniform3fv(uniforms.sky, this.sky.slice(0, 3));
  }

  paintGround() {
    const { gl, layers, layersDrawn } = this;
    this.everywhere.ground.draw(gl);
    if (layers.roads) this.paintSurfaces();
    for (const name of ["crosswalks", "lines", "edges", "route"]) if (layers[name]) layersDrawn[name].draw(gl);
    for (const run of this.runs.shown) {
      if (!this.paths.has(run)) this.paths.set(run, new GroundBuffer(gl, runMesh(run, runWidth)));
      this.paths.get(run).draw(gl);
    }
  }

  // Count in the stencil buffer how often an outline winds around each pixel, then paint where it does.
  paintSurfaces() {
    const { gl } = this;
    gl.enable(gl.STENCIL_TEST);
    gl.colorMask(false, false, false, false);
    gl.stencilFunc(gl.ALWAYS, 0, 255);
    gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
    gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
    this.layersDrawn.roads.draw(gl);
    gl.colorMask(true, true, true, true);
    gl.stencilFunc(gl.NOTEQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.ZERO);
    this.everywhere.road.draw(gl);
    gl.disable(gl.STENCIL_TEST);
  }

  // --- pointers ----------------------------------------------------------------------------------

  listen() {
    const { canvas, camera } = this;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.prepare());
    canvas.addEventListener("dblclick", () => this.fitRoute());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault()); // its button moves the view
    this.pointers = new Pointers(canvas, {
      drag: (dx, dy, event) => {
        const isMoving = event.shiftKey || event.buttons & 2;
        if (isMoving) this.follows = false;
        camera[isMoving ? "pan" : "turn"](dx, dy);
        this.moved();
      },
      zoom: (factor) => { camera.zoom(factor); this.moved(); },
      hover: (place) => this.hover(place),
      pick: (place) => this.onPick(this.under(place).object),
    });
  }

  // Object and map feature at a canvas position, as rows; -1 for none.
  under([px, py]) {
    const ray = this.camera.ray(px, py);
    const object = this.layers.objects ? this.objects.hit(ray, this.scene.at(this.clock.time)) : -1;
    const [x, y] = [0, 1].map((k) => ray.eye[k] - (ray.direction[k] * ray.eye[2]) / ray.direction[2]);
    const isGround = ray.direction[2] < -0.02;
    const feature = object < 0 && isGround ? this.featureAt(x, y, 0.4) : -1;
    return { object, feature };
  }
}
