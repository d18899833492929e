#include "apron/run/ui/RunWithUi.h"

#include "apron/run/ui/UiRunContext.h"
#include "apron/ui/window/Window.h"
#include "common/error/UserError.h"
#include "common/process/StopSignals.h"
#include "common/process/WindowLibrary.h"

namespace apron::run {

std::string ui_unavailable_reason(const Options& options) {
  if (!options.window) return {};
  common::require_window_library();
  if (ui::Window::display_available()) return {};
  return "--window: there is no display to open a window on: set DISPLAY, or use --screenshot or --video";
}

UiRunResult run_with_ui(const UiRun& run) {
  UiRunResult result;
  UiRunContext context(run);
  try {
    if (!run.options.show.empty() && !context.model.find_register(run.options.show))
      throw common::UserError("--show: the program has no register '" + run.options.show + "'");
    if (run.options.window)
      run_in_window(context);
    else
      run_offscreen(context);
  } catch (const common::UserError& error) {
    result.ui_error = error.what();
  }
  // A program that could continue ends when the window is closed or a signal arrives.
  result.status = context.session.state() == debugger::ExecutionState::kFinished ? context.session.status()
                                                                                 : vm::Status::kEnded;
  if (common::stop_flag()) result.status = vm::Status::kInterrupted;
  result.error = context.session.vm().error();
  result.ticks = context.session.ticks();
  result.save_error = save_registers(run.options.saved, context.session.vm());
  result.profile = context.session.vm().profile();
  return result;
}

}  // namespace apron::run
