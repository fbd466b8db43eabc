// What stands around a request in a shell: the place of the token, and what is told of a command that is copied.

import { isTokenWanted } from "./api";
import { copied } from "./dom";
import { COMMAND } from "./strings";

// Of a request that changes something, where the page knows that the server wants its token: it was refused without, or
// it came from another machine, from which nothing is changed without.
export function tokenHeader(): string {
  const isHere = /^(localhost|127\.[\d.]+|\[::1\])$/.test(location.hostname);
  return isHere && !isTokenWanted() ? "" : ' -H "Authorization: Bearer $TOKEN"';
}

// Copies the command that an element shows, or has it selected; gives what to say of it.
export async function copyCommand(shown: HTMLElement): Promise<string> {
  const said = (await copied(shown)) ? COMMAND.copied : COMMAND.selected;
  return shown.textContent?.includes("$TOKEN") ? `${said} ${COMMAND.token}` : said;
}
