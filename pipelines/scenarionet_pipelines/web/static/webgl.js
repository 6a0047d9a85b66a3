// The two programs of the view in space, and their buffers.

const haze = `
vec3 hazy(vec3 color, vec3 place, vec3 eye, vec3 sky) {
  return mix(color, sky, smoothstep(150.0, 1100.0, distance(place, eye)));
}`;

const groundVertex = `#version 300 es
layout(location = 0) in vec3 point; layout(location = 1) in vec4 color;
uniform mat4 matrix; out vec4 tint; out vec3 place; out float along;
void main() { place = vec3(point.xy, 0.0); along = point.z; tint = color; gl_Position = matrix * vec4(place, 1.0); }`;

const groundFragment = `#version 300 es
precision highp float;
in vec4 tint; in vec3 place; in float along; uniform vec3 eye; uniform vec3 sky; out vec4 shown;${haze}
void main() {
  if (along > -1e8 && fract(along) > 0.5) discard;
  shown = vec4(hazy(tint.rgb, place, eye, sky), tint.a);
}`;

const shapeVertex = `#version 300 es
layout(location = 0) in vec3 point; layout(location = 1) in vec3 normal; layout(location = 2) in float glass;
layout(location = 3) in vec3 foot; layout(location = 4) in vec2 turn; layout(location = 5) in vec3 size; layout(location = 6) in vec4 color;
uniform mat4 matrix; out vec4 tint; out vec3 place; out vec3 facing;
vec3 turned(vec3 v) { return vec3(turn.x * v.x - turn.y * v.y, turn.y * v.x + turn.x * v.y, v.z); }
void main() {
  place = foot + turned(point * size);
  facing = normalize(turned(normal / max(size, vec3(1e-3))));
  tint = vec4(mix(color.rgb, vec3(0.09, 0.12, 0.16), 0.85 * glass), color.a);
  gl_Position = matrix * vec4(place, 1.0);
}`;

const shapeFragment = `#version 300 es
precision highp float;
in vec4 tint; in vec3 place; in vec3 facing; uniform vec3 eye; uniform vec3 sky; out vec4 shown;${haze}
const vec3 sun = vec3(0.38, 0.28, 0.88);
void main() {
  vec3 side = normalize(facing);
  float light = 0.52 + 0.13 * side.z + 0.42 * max(dot(side, sun), 0.0);
  shown = vec4(hazy(tint.rgb * min(light, 1.12), place, eye, sky), tint.a);
}`;

export const numInstance = 12; // values of one object: foot 3, cosine and sine, size 3, colour 4

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(`a program of the view in space does not link: ${gl.getProgramInfoLog(made)}`);
  const uniforms = Object.fromEntries(["matrix", "eye", "sky"].map((name) => [name, gl.getUniformLocation(made, name)]));
  return { program: made, uniforms };
}

export function programs(gl) {
  return { ground: program(gl, groundVertex, groundFragment), shape: program(gl, shapeVertex, shapeFragment) };
}

function buffer(gl, target, content, usage = gl.STATIC_DRAW) {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, content, usage);
  return made;
}

// Triangles on the ground; see space_ground.js.
export class GroundBuffer {
  constructor(gl, { points, colors, corners }) {
    this.count = corners.length;
    this.state = gl.createVertexArray();
    gl.bindVertexArray(this.state);
    buffer(gl, gl.ARRAY_BUFFER, new Float32Array(points));
    attribute(gl, 0, 3, 12, 0);
    buffer(gl, gl.ARRAY_BUFFER, new Uint8Array(colors));
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 4, 0);
    buffer(gl, gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners));
    gl.bindVertexArray(null);
  }

  draw(gl) {
    if (!this.count) return;
    gl.bindVertexArray(this.state);
    gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_INT, 0);
  }
}

// One shape, drawn for any number of objects in one call.
export class ShapeBuffer {
  constructor(gl, corners) {
    this.numCorners = corners.length / 7;
    this.room = 0;
    this.state = gl.createVertexArray();
    gl.bindVertexArray(this.state);
    buffer(gl, gl.ARRAY_BUFFER, corners);
    attribute(gl, 0, 3, 28, 0);
    attribute(gl, 1, 3, 28, 12);
    attribute(gl, 2, 1, 28, 24);
    this.objects = buffer(gl, gl.ARRAY_BUFFER, 0, gl.DYNAMIC_DRAW);
    for (const [location, size, offset] of [[3, 3, 0], [4, 2, 12], [5, 3, 20], [6, 4, 32]]) {
      attribute(gl, location, size, 4 * numInstance, offset);
      gl.vertexAttribDivisor(location, 1);
    }
    gl.bindVertexArray(null);
  }

  draw(gl, values, count) {
    if (!count) return;
    gl.bindVertexArray(this.state);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.objects);
    if (values.length > this.room) {
      gl.bufferData(gl.ARRAY_BUFFER, 4 * values.length, gl.DYNAMIC_DRAW);
      this.room = values.length;
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, values, 0, count * numInstance);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, this.numCorners, count);
  }
}

function attribute(gl, location, size, stride, offset) {
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, gl.FLOAT, false, stride, offset);
}
