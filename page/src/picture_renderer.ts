// SPDX-License-Identifier: MIT
//
// The WebGL renderer and its level of detail, which adapts to the frame rate.

import { WebGLRenderer, type Camera, type Scene } from "three";

export interface Level {
  readonly smooth: boolean;
  /** Largest number of drawn pixels per CSS pixel. */
  readonly ratio: number;
  readonly shadow: boolean;
}

/** Levels of detail, from the highest. A ratio below 1 would look coarse and save nothing: in software rendering, most
 * of a frame's time is spent on compositing the canvas with the cards. */
const LEVELS: readonly Level[] = [
  { smooth: true, ratio: 2, shadow: true },
  { smooth: false, ratio: 2, shadow: true },
  { smooth: false, ratio: 1.5, shadow: true },
  { smooth: false, ratio: 1, shadow: true },
  { smooth: false, ratio: 1, shadow: false },
];
/** [ms] Mean frame time of a window above which the level is lowered, and below which it is raised. */
const SLOW_MS = 1000 / 27, QUICK_MS = 1000 / 52;
const WINDOW_MS = 1200, RAISED_AFTER_MS = 5000;
/** [ms] A longer gap is due to a hidden page, not to a slow frame. */
const UNSEEN_MS = 400;
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

export class Renderer {
  readonly software: boolean;
  private level: number;
  private gl: WebGLRenderer;
  private size = [1, 1] as [number, number];
  private begun = 0;
  private pictures = 0;
  private quickSince = 0;
  private last = 0;
  /** Largest index of a level that was too slow. */
  private failed = -1;
  private readonly stage: HTMLElement;

  /** Throws without WebGL. */
  constructor(stage: HTMLElement) {
    this.stage = stage;
    this.gl = this.made(false);
    const context = this.gl.getContext(), info = context.getExtension("WEBGL_debug_renderer_info");
    const name = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER));
    this.software = SOFTWARE.test(name);
    this.level = this.next(-1, 1);
    if (this.software) this.level = this.next(this.level, 1);
    this.adopt();
  }

  get shown(): Level { return LEVELS[this.level]!; }
  get canvas(): HTMLCanvasElement { return this.gl.domElement; }

  resize(width: number, height: number): void {
    this.size = [width, height];
    this.gl.setPixelRatio(this.ratio(this.shown));
    this.gl.setSize(width, height, false);
  }

  draw(scene: Scene, camera: Camera): void { this.gl.render(scene, camera); }

  /** Count a frame drawn at this time [ms]; returns whether the level has changed. */
  judge(now: number): boolean {
    const gap = now - this.last;
    this.last = now;
    if (gap > UNSEEN_MS || !this.begun) { this.begun = now; this.pictures = 0; this.quickSince = now; return false; }
    this.pictures++;
    const window = now - this.begun;
    if (window < WINDOW_MS) return false;
    const mean = window / this.pictures;
    this.begun = now;
    this.pictures = 0;
    if (mean > QUICK_MS) this.quickSince = now;
    let level = this.level;
    if (mean > SLOW_MS) { level = this.next(level, 1); this.failed = Math.max(this.failed, this.level); }
    else if (now - this.quickSince > RAISED_AFTER_MS && this.next(level, -1) > this.failed) level = this.next(level, -1);
    if (level === this.level) return false;
    this.level = level;
    this.quickSince = now;
    this.begun = 0;
    this.adopt();
    return true;
  }

  private ratio(level: Level): number { return Math.min(level.ratio, Math.max(1, devicePixelRatio || 1)); }

  /** The next level that makes a difference on this screen; the same level if there is none. */
  private next(from: number, step: 1 | -1): number {
    const before = LEVELS[from];
    for (let k = from + step; k >= 0 && k < LEVELS.length; k += step) {
      const level = LEVELS[k]!;
      if (!before || level.smooth !== before.smooth || level.shadow !== before.shadow || this.ratio(level) !== this.ratio(before)) return k;
    }
    return from;
  }

  private adopt(): void {
    if ((this.gl.getContextAttributes()?.antialias ?? false) !== this.shown.smooth) {
      const before = this.gl;
      this.gl = this.made(this.shown.smooth);
      before.domElement.remove();
      before.dispose();
      before.forceContextLoss();
    }
    this.resize(...this.size);
  }

  private made(antialias: boolean): WebGLRenderer {
    const gl = new WebGLRenderer({ antialias, alpha: false, stencil: true, powerPreference: "high-performance" });
    gl.debug.checkShaderErrors = false;
    gl.domElement.setAttribute("aria-hidden", "true");
    this.stage.prepend(gl.domElement);
    return gl;
  }
}
