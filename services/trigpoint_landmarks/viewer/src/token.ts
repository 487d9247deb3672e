/** The token somebody entered: kept until the tab is closed, and nowhere else. */

const KEY = "trigpoint-token";

export function keptToken(): string {
  return sessionStorage.getItem(KEY) ?? "";
}

export function keepToken(token: string): void {
  if (token) sessionStorage.setItem(KEY, token);
  else sessionStorage.removeItem(KEY);
}

/** What shows the token to the service; nothing without one. */
export function tokenHeaders(): Record<string, string> {
  const token = keptToken();
  return token ? { Authorization: `Bearer ${token}` } : {};
}
