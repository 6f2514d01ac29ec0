// SPDX-License-Identifier: MIT

import type { Card, Desk } from "./panel.ts";
import { button, copied, make, save, say } from "./panel_elements.ts";
import { Track } from "./plots.ts";
import { words } from "./words.ts";

/** A link, the page as a file, the take for the command line, a picture; and a take kept to compare the next one with. */
export function keepCard(desk: Desk): Card {
  const { motion, look } = desk, w = words.keep;
  const failed = (error: unknown): void => say(error instanceof Error ? error.message : String(error));
  const link = make("input", { class: "text", readonly: true, hidden: true, "aria-label": w.linked });
  const share = async (): Promise<void> => {
    const text = await motion.link();
    if (!text) { say(w.ownMesh); return; }
    await copied(`${location.href.split("#")[0]}#${text}`, link);
  };
  const take = (): void => {
    const files = motion.take();
    save("scene.yaml", new Blob([files.scene]));
    save("script.yaml", new Blob([files.script]));
    if (files.mesh) save(files.mesh.name, new Blob([files.mesh.bytes as Uint8Array<ArrayBuffer>]));
    command.textContent = files.command;
    command.hidden = false;
    void motion.hash().then((hash) => { hashed.textContent = hash; }, failed);
  };
  const command = make("code", { hidden: true }), hashed = make("code");
  command.style.cssText = hashed.style.cssText = "font-size: 0.75rem; overflow-wrap: anywhere; user-select: all";
  const compared = make("p");
  const keep = button(w.keepTake, () => {
    const kept = new Track();
    kept.seen.push(...desk.track().seen);
    look.kept = kept;
    changed();
  });
  const forget = button(w.forget, () => { look.kept = null; changed(); });
  const changed = (): void => {
    forget.hidden = look.kept === null;
    const last = look.kept?.seen[look.kept.seen.length - 1];
    if (!last) compared.textContent = "";
  };
  const asPicture = button(w.picture, () => void desk.picture.saved("#f3f5fa").then((blob) => save("rigid_body.png", blob), failed));
  const node = !motion.can.keep ? make("div", {}, make("div", { class: "row" }, asPicture, keep, forget), make("p", { class: "note" }, w.keepNote), compared, make("p", { class: "note" }, words.live.recorded)) : make("div", {},
    make("h3", {}, w.share), make("div", { class: "row" }, button(w.link, () => void share().catch(failed)), link,
      button(w.page, () => void motion.file().then((blob) => save("rigid_body.html", blob), failed)), asPicture),
    make("p", { class: "note" }, w.pageNote),
    make("h3", {}, w.compare), make("div", { class: "row" }, keep, forget), make("p", { class: "note" }, w.keepNote), compared,
    make("h3", {}, w.script), make("div", { class: "row" }, button(w.files, take)), make("p", {}, command), make("p", { class: "note" }, `${w.command} `, hashed));
  return {
    node, changed,
    show(now) {
      const pose = look.kept?.pose(now.timeNs), last = look.kept?.seen[look.kept.seen.length - 1];
      if (!pose || !last) return;
      const [a, b] = [pose.row, now.body.row], dot = Math.abs(a[3]! * b[3]! + a[4]! * b[4]! + a[5]! * b[5]! + a[6]! * b[6]!);
      compared.textContent = `${w.kept(last.now.timeNs * 1e-9)}, ${w.apart(((2 * Math.acos(Math.min(1, dot)) * 180) / Math.PI).toFixed(0))}`;
    },
  };
}
