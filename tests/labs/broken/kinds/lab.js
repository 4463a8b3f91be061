import { draw } from "https://example.org/draw.js";

draw();
