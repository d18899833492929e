// The state shared by windowed and off-screen runs. Internal to RunWithUi.
#pragma once

#include "apron/debugger/DebugSession.h"
#include "apron/debugger/FrontPanel.h"
#include "apron/debugger/PanelHost.h"
#include "apron/run/ui/UiRun.h"
#include "apron/ui/ViewModel.h"

namespace apron::run {

// The debug session of a run with its host, panel and view model.
struct UiRunContext {
  explicit UiRunContext(const UiRun& run);

  const UiRun& run;
  debugger::FrontPanel panel;
  debugger::PanelHost host;
  debugger::DebugSession session;
  ui::ViewModel model;
};

// Both throw common::UserError.
void run_in_window(UiRunContext& context);
void run_offscreen(UiRunContext& context);

}  // namespace apron::run
