// Shell command of a request: authorization header and copying.

import { isTokenRequired } from "./api";
import { copyText } from "./dom";
import { COMMAND } from "./strings";

// Authorization header of a write request, if the server is known to require a token: after a 401, or from another
// machine, where write requests always need one.
export function tokenHeader(): string {
  const isLocal = /^(localhost|127\.[\d.]+|\[::1\])$/.test(location.hostname);
  return isLocal && !isTokenRequired() ? "" : ' -H "Authorization: Bearer $TOKEN"';
}

// Copies the command in `element`, or selects it. Returns the message for the user.
export async function copyCommand(element: HTMLElement): Promise<string> {
  const message = (await copyText(element)) ? COMMAND.copied : COMMAND.selected;
  return element.textContent?.includes("$TOKEN") ? `${message} ${COMMAND.token}` : message;
}
