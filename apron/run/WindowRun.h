// The two ways to draw a run. Internal to DrawnRun.
#pragma once

#include "apron/debugger/FrontPanel.h"
#include "apron/debugger/PanelHost.h"
#include "apron/debugger/Session.h"
#include "apron/run/DrawnRun.h"
#include "apron/ui/Workbench.h"

namespace apron::run {

// What both have.
struct Drawn {
  explicit Drawn(const DrawnRun& run);

  const DrawnRun& run;
  debugger::FrontPanel panel;
  debugger::PanelHost host;
  debugger::Session session;
  ui::Workbench bench;
};

// Both throw ui::PictureError.
void run_in_window(Drawn& drawn);
void run_for_pictures(Drawn& drawn);

}  // namespace apron::run
