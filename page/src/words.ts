// SPDX-License-Identifier: MIT
//
// All texts of the page. Another language is another catalogue of this type (languages.ts).

import { addressOf } from "./address.ts";
import { LANGUAGES } from "./languages.ts";
import { short } from "./words_numbers.ts";

export const english = {
  title: "One rigid body",
  notANumber: (text: string) => `${text.trim() || "Nothing"} isn't a number`,
  close: "close",
  picture: {
    name: "The body. Arrow keys move the aim, Enter pokes there, G grabs and lets go; Shift and arrow keys turn the view, plus and minus zoom, 0 goes back",
    body: "the body as it is now",
    weight: (newtons: string) => `weight ${newtons} N`,
    pull: "pull me",
    noWebGL: "This browser draws no WebGL: the picture is a plain one.",
    incomplete: "the file holds no kernels",
    broken: (why: string) => `The page can't start: ${why}`,
  },
  pointer: { nothingThere: "There is no body where you aim" },
  tensor: { name: "Tensor", true: "true tensor", box: "bounding box" },
  hand: {
    name: "Body and hand", mass: "mass", sizes: ["size x", "size y", "size z"], poke: "poke", lock: "equal sizes",
    lockTitle: "Change all three sizes together",
  },
  energy: { name: "energy", ghost: "ghost", spin: "spin", move: "move", string: "string", height: "height", all: "all" },
  angle: { name: "angle to the ghost", kept: "angle to the kept take" },
  time: {
    name: "Time", play: "Play", pause: "Pause", step: "Step 0.01 s", back: "−2 s", backTitle: "Back 2 s", rate: "How fast time goes",
    rates: ["1 ×", "½ ×", "¼ ×", "⅒ ×", "1⁄50 ×"], scrub: "Moment of the take", reset: "Start again", goOn: "go on from here",
    goOnTitle: "Forget what came after this moment, and fly on", seconds: (s: number) => `${s.toFixed(2)} s`,
  },
  live: {
    yours: "You drive", others: "Somebody else drives", free: "Nobody drives: touch it", locked: "Its owner drives",
    away: "Not reached; trying again", lost: "The node isn't reached any more; trying again.", ask: "ask for it", asked: "asked",
    asking: (n: number) => (n === 1 ? "somebody asks" : `${n} ask`), give: "give it", take: "take it",
    lock: "lock", unlock: "unlock", watching: (n: number) => `${n} look`,
    past: "This is the past: go to now first.", now: "to now", nowTitle: "What the node does now; to fly on from a moment: rigid_proto replay --at T --as-scene",
    ghost: "A node's ghost differs in tensor or integrator alone", files: "Files of one's own are opened where the node was started: its parameter mesh",
    recorded: "What a node does is recorded there: its parameter record, and rigid_proto replay",
    step: "Step to the next publication", rate: (rate: number) => (rate === 0 ? "as fast as it goes" : `${rate} ×`),
  },
  cards: { lessons: "lessons", body: "body", world: "gravity", ghost: "ghost", tensor: "tensor", measure: "measure", plots: "plots", keep: "keep" },
  bodies: {
    book: "book", hammer: "hammer", hollow_box: "hollow box", l_bracket: "l bracket", spinning_top: "spinning top", t_handle: "t handle", teapot: "teapot", tennis_racket: "tennis racket",
  } as Record<string, string>,
  body: {
    name: "Body", bundled: "Ready-made", scenes: "Flights", own: "Your own", choose: "choose a file",
    drop: "Drop the file here", formats: ".obj, .stl, .ply or .glb, up to 50 MB. It stays on this machine.", unit: "one unit is",
    units: [["", "as it seems"], ["1", "1 m"], ["0.01", "1 cm"], ["0.001", "1 mm"], ["0.0254", "1 inch"]] as const,
    sound: "Closed, and wound alike. Whether it crosses itself isn't judged here.", tooLarge: "The file is larger than 50 MB",
    mass: "Mass", fixed: "mass", dense: "density", model: "Where the mass is",
    models: { solid: "all through (true)", shell: "in the skin", points: "in the corners", bounding_box: "in the bounding box", walled: "in walls (printed)", explicit: "numbers of its own" } as Record<string, string>,
    table: "Moments [kg m²]", beside: "beside the truth", ballast: "Ballast", add: "stick on",
    addTitle: "Then press the place of the body", press: "Press the place on the body", remove: "remove", none: "none",
    walls: "wall thickness", infill: "infill",
    centre: "centre", ownNote: "Mass and tensor of your own, about the centre of mass, in the mesh's axes [kg m²].",
    copyFor: "Copy for", copy: "copy", lines: "Mass, centre and tensor as an engine takes them",
    facts: (vertices: number, triangles: number, litres: string) => `${vertices} vertices, ${triangles} triangles${litres ? `, ${litres} l` : ""}`,
  },
  world: {
    name: "World", gravity: "Gravity", down: "downwards", places: [["none", 0], ["Moon", 1.62], ["Mars", 3.71], ["Earth", 9.81]] as const,
    damping: "Damping", linear: "of speed", angular: "of spin", start: "Spin at the start", startNote: "Acts when you start again.",
    flywheel: "Flywheel", wheel: "momentum", motor: "motor", flywheelNote: "In axes of the body. A motor spins wheel and body up against each other; L is that of both.",
    motion: "Law of motion", gyroscopic: "gyroscopic term ω × Iω", integrator: "integrator", step: "step",
  },
  ghost: {
    name: "Ghost", about: "It starts as the body does and gets the same pulls and pokes. What differs:",
    kinds: { "": "no ghost", bounding_box: "tensor of the bounding box", solid: "true tensor", shell: "mass in the skin", points: "mass in the corners", gyroscopic: "no gyroscopic term: as Jolt, Havok, PhysX, cannon-es", mujoco: "as MuJoCo at 1/60 s", integrator: "another integrator or step" } as Record<string, string>,
    integrator: "integrator", step: "step", same: "as the body", sixtieth: "1/60 s", hundredth: "0.01 s", thousandth: "1 ms",
    apart: "beside the body", again: "It flies from the start of the take on.",
    sources: {
      gyroscopic: "By default these engines keep ω where the law of motion keeps L: they leave ω × Iω out. Jolt and PhysX have a switch for it.",
      mujoco: "MuJoCo's default, Euler's method, takes new velocities from the old ones, then moves with the new: semi_implicit_euler here.",
    } as Record<string, string>,
    noFlywheel: "A body of these engines has no flywheel; the ghost has that of the body.",
    measured: "Measured: 60 s about the middle axis, in which the true motion flips 9 times and keeps its energy", heads: ["at 1/60 s", "flips", "energy"],
    measuredNote: (date: string) => `${date}; other engines, steps and versions: docs/benchmarks.md, Physics engines.`, kept: "kept", notFlown: "not flown",
  },
  inertia: {
    name: "Tensor", about: "[kg m²] about the centre of mass, in the axes x′ y′ z′. Turn them:", turn: ["about x", "about y", "about z"],
    principal: "principal axes", mesh: "axes of the mesh", products: (part: string) => `Largest product: ${part} % of the largest moment.`,
    none: "The products vanish: these are principal axes.", shapes: "In the picture", box: "inertia box", ellipsoid: "inertia ellipsoid",
    axes: "axes I₁ I₂ I₃", bounding: "bounding box", poinsot: "Poinsot's construction", rolls: "ellipsoid that rolls on a plane", cones: "cones of body and space",
    poinsotNote: "The plane stands across L, and ω ends where the ellipsoid touches it. Without pulls and pokes the plane stays, and the ellipsoid rolls on it.",
    poinsotFlywheel: "With a flywheel ω doesn't end on that plane: nothing is drawn.",
  },
  measure: {
    name: "Measure", protractor: "Protractor", between: "between", and: "and", off: "off",
    things: { omega: "ω", momentum: "L", one: "I₁", two: "I₂", three: "I₃", up: "upwards", start: "L at first", velocity: "velocity" } as Record<string, string>,
    watch: "Stopwatch", start: "start", stop: "stop", clear: "clear", trace: "Trace", far: "farthest point", own: "a point I press",
    chalk: "Chalk", draw: "draw on the body", wipe: "wipe off", drawNote: "Drag over the body to draw; press again to pull it",
    com: "centre of mass", readings: "Readings", speed: "speed", spin: "spin",
    sensitivity: "Sensitivity", again: "fly again, ten times as accurate", accuracySet: "Accuracy, step or integrator change within this take.",
    moved: (degrees: string, metres: string, finer: string) => `With ${finer} the body is now ${degrees}° and ${metres} m from here.`,
    chaos: "A small error has grown large: chaos.", holds: "The motion is as good as that.",
  },
  plots: { name: "Plots", energy: "Energy", omega: "ω in principal axes", momentum: "L in world axes", angle: "Angle to the ghost" },
  keep: {
    name: "Keep", share: "Share", link: "copy link", copied: "Copied.", linked: "Copy this:", ownMesh: "A link holds no mesh of your own: save the page.",
    page: "save this page", pageNote: "One file with body and take. It opens without a network.", picture: "save a picture",
    script: "For the command line", files: "save as files", command: "gives the same state hash:", hash: "state hash", compare: "Compare",
    keepTake: "keep this take", keepNote: "It flies on as a grey body beside the next one.", forget: "forget it", kept: (s: number) => `Kept: ${s.toFixed(1)} s`,
    apart: (degrees: string) => `${degrees}° apart now`,
  },
  lessons: { name: "Lessons", about: "Each begins with a question. The body stands until you answer." },
  lesson: {
    name: "Lesson", none: "no lesson", leave: "leave the lesson", class: "class mode", classTitle: "For a projector: large words, and nothing else to read",
    letters: ["A", "B", "C"], first: "Answer first: A, B or C", right: "Right.", wrong: (letter: string, choice: string) => `No, it is ${letter}: ${choice}`,
    why: "why?", steps: "Try it", done: (k: number, all: number) => `Step ${k} of ${all} is done.`, finished: "All steps are done.", ticked: "done", now: "now", anew: "begin the lesson again",
    unknown: (name: string) => `There is no lesson ${name}`, swings: "It still swings: wait until it hangs at rest.", untied: "No string is tied.", tied: "The string holds it: click to poke it.",
    places: { tip: "tip", rim: "rim", grip: "grip", head: "head", corner: "corner", stem: "stem", spout: "spout", handle: "handle", knob: "knob", com: "centre of mass" } as Record<string, string>,
    poke: (place: string) => `poke: ${place}`, again: (place: string) => `start again, and poke: ${place}`, restart: "start again", pull: "show me how", press: "take me there", pullHow: "Drag the body with the pointer, or with G and arrow keys",
    pressHow: "Press a place of the body, or aim with arrow keys and press Enter", throwAbout: (axis: string) => `throw it about ${axis}`, withoutTerm: "term off, and start again",
    termOn: "switch the term on", termOff: "switch the term off", box: "bounding box", truth: "true tensor", corners: "mass in the corners", stick: "stick on 30 g, and start again", unstick: "take it off",
    ballast: "open ballast", card: "open the card", ghosts: { gyroscopic: "ghost as in Jolt, and start again", mujoco: "ghost as in MuJoCo, and start again" }, energies: "plot the energies", poinsot: "show the ellipsoid", principal: "show the axes", turn: "open the axes", aboutThird: "spin about I₃", chalk: "draw the line", tie: "tie it here", tieHow: "Press the place to tie it, or aim with arrow keys and press Enter",
    twice: "spin × 2", half: "spin × ½", noSpin: "no spin", trace: "trace the grip", weightless: "gravity off", moments: "open the table", wheel: (h: string) => `wheel: ${h} N m s, and start again`, motor: "at rest, with a motor", tenfold: "mass × 10", tenth: "mass as before",
  },
  percent: (part: number) => (Number.isFinite(part) ? `${part < 0 ? "−" : "+"}${short(Math.abs(part), 2)} %` : "–"),
};

export type Words = typeof english;

/** The code of the language that the address names, or of the first of the reader's languages that exists. */
function spoken(): string {
  if (typeof location === "undefined") return "en";
  const asked = addressOf(location.hash).language, wanted = asked ? [asked] : navigator.languages;
  return wanted.map((code) => code.toLowerCase().split("-")[0]!).find((code) => code === "en" || code in LANGUAGES) ?? "en";
}

export const language = spoken();
export const words: Words = LANGUAGES[language]?.words ?? english;
