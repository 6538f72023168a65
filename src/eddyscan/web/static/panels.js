// One panel per step.

import { Align } from "./panel-align.js";
import { Plan } from "./panel-plan.js";
import { Report } from "./panel-report.js";
import { Results } from "./panel-results.js";
import { Scan } from "./panel-scan.js";
import { Surface } from "./panel-surface.js";
import { Views } from "./panel-views.js";

export const panels = { views: Views, surface: Surface, plan: Plan, align: Align, record: Scan, cscan: Results, report: Report };
