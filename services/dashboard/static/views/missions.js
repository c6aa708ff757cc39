// Made next.
import { head } from "../dom.js";
export const topics = [];
export function show(root) { root.append(head("missions")); }
