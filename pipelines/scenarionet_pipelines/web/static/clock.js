// Playback time: runs at a multiple of the recording's speed and stops at the end.

export class Clock {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.isRunning = false;
    this.before = null;
  }

  // Advance to the time of an animation frame [ms].
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
