#include "apron/run/ui/UiRunContext.h"

#include "apron/run/ui/ConditionCompiler.h"
#include "common/process/StopSignals.h"

namespace apron::run {
namespace {

vm::VmOptions vm_options(const Options& options) {
  vm::VmOptions result;
  result.threads = options.threads;
  result.isa = options.isa;
  result.stop = &common::interrupt_flag();
  result.refuse_endless_ticks = options.ticks.has_value();
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
  if (run.shown_registers != nullptr)
    run.host.before_answer([this] { run.shown_registers->write(session.vm()); });
  if (ui_run.options.ticks) session.limit_ticks(*ui_run.options.ticks);
  if (!ui_run.options.profile.empty()) session.set_profiling(true);
  model.set_surface_layout(
      ui::CellLayout::of_surface(ui_run.positions, ui_run.height, ui_run.width, ui_run.pitch), ui_run.width,
      ui_run.height);
  model.show_program(ui_run.compiled.program, ui_run.compiled.sources, 1);
  if (const auto reg = model.find_register(ui_run.options.show)) model.select(*reg);
}

}  // namespace apron::run
