// The time that is shown: it runs at the speed of the recording, or a multiple of it, and stops at the end.

export class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.isRunning = false;
    this.before = null;
  }

  // Go on to the moment of a frame [ms].
  tick(now) {
    if (this.isRunning && this.before !== null) {
      this.time = Math.min(this.duration, this.time + ((now - this.before) / 1000) * this.speed);
      if (this.time >= this.duration) this.isRunning = false;
    }
    this.before = this.isRunning ? now : null;
  }

  toggle() {
    if (!this.isRunning && this.time >= this.duration) this.time = 0;
    this.isRunning = !this.isRunning && this.duration > 0;
    this.before = null;
  }

  set(time) {
    this.time = Math.min(this.duration, Math.max(0, time));
  }
}
