#include "apron/run/ui/UiRun.h"

#include "apron/run/ui/ConditionCompiler.h"
#include "apron/run/ui/UiRunContext.h"
#include "apron/ui/window/Window.h"
#include "common/error/UserError.h"
#include "common/process/StopSignals.h"

namespace apron::run {
namespace {

vm::VmOptions vm_options(const Options& options) {
  vm::VmOptions result;
  result.threads = options.threads;
  result.isa = options.isa;
  result.stop = &common::interrupt_flag();
  return result;
}

ui::ViewModel::ConditionCompiler condition_compiler(const UiRun& run) {
  return [width = run.width, height = run.height](const std::string& condition,
                                                  const program::Program& debuggee) {
    ui::ViewModel::CompiledCondition compiled;
    compiled.program = compile_condition(condition, debuggee, width, height, compiled.error);
    return compiled;
  };
}

}  // namespace

UiRunContext::UiRunContext(const UiRun& ui_run)
    : run(ui_run),
      host(ui_run.host, panel),
      session(ui_run.compiled.program, vm_options(ui_run.options), host, ui_run.on_pause),
      model(panel, condition_compiler(ui_run)) {
  for (const auto& [name, value] : ui_run.options.parameters) panel.set_parameter(name, value);
  if (ui_run.options.ticks) session.limit_ticks(*ui_run.options.ticks);
  if (!ui_run.options.profile.empty()) session.set_profiling(true);
  model.show_program(ui_run.compiled.program, ui_run.compiled.sources, 1);
  if (const auto reg = model.find_register(ui_run.options.show)) model.select(*reg);
}

std::string ui_unavailable_reason(const Options& options) {
  if (!options.window || ui::Window::display_available()) return {};
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
