// SPDX-License-Identifier: MIT
//
// The fragment (#) of the page's address: a lesson, class mode and a language, by name; or a take (take.ts).

export interface Address {
  readonly lesson: string;
  readonly isClass: boolean;
  readonly language: string;
  readonly take: string;
}

/** `#lesson=NAME&class&lang=CODE`, or a take's text with or without a language. */
export function addressOf(hash: string): Address {
  const parts = hash.replace(/^#/, "").split("&");
  const named = (name: string): string => decodeURIComponent(parts.find((part) => part.startsWith(`${name}=`))?.slice(name.length + 1) ?? "");
  const take = parts.find((part) => part !== "" && part !== "class" && !/^(?:lesson|lang)=/.test(part)) ?? "";
  return { lesson: named("lesson"), isClass: parts.includes("class"), language: named("lang"), take };
}

export function hashOf({ lesson, isClass, language, take }: Partial<Address>): string {
  const parts = [lesson ? `lesson=${lesson}` : "", isClass ? "class" : "", take ?? "", language ? `lang=${language}` : ""].filter((part) => part !== "");
  return `#${parts.join("&")}`;
}
