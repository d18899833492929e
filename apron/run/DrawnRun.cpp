#include "apron/run/DrawnRun.h"

#include "apron/run/Question.h"
#include "apron/run/StopSignal.h"
#include "apron/run/WindowRun.h"
#include "apron/ui/Window.h"

namespace apron::run {
namespace {

vm::VmOptions vm_options(const Options& options) {
  vm::VmOptions how;
  how.threads = options.threads;
  how.stop = &interrupt_flag();
  return how;
}

ui::Workbench::Ask asker(const DrawnRun& run) {
  return [width = run.width, height = run.height](const std::string& condition,
                                                  const program::Program& watched) {
    ui::Workbench::Question question;
    question.program = compile_question(condition, watched, width, height, question.wrong);
    return question;
  };
}

}  // namespace

Drawn::Drawn(const DrawnRun& r)
    : run(r),
      host(r.host, panel),
      session(r.compiled.program, vm_options(r.options), host, r.on_hold),
      bench(panel, asker(r)) {
  for (const auto& [name, value] : r.options.parameters) panel.set_parameter(name, value);
  if (r.options.ticks) session.limit_ticks(*r.options.ticks);
  if (!r.options.profile.empty()) session.profile(true);
  bench.show_program(r.compiled.program, r.compiled.texts, 1);
  if (const auto reg = bench.find_register(r.options.show)) bench.select(*reg);
}

std::string drawing_unavailable(const Options& options) {
  if (!options.window || ui::Window::display_available()) return {};
  return "--window: there is no display to open a window on: set DISPLAY, or use --screenshot or --video";
}

DrawnOutcome run_drawn(const DrawnRun& run) {
  DrawnOutcome outcome;
  Drawn drawn(run);
  try {
    if (!run.options.show.empty() && !drawn.bench.find_register(run.options.show))
      throw ui::PictureError("--show: the program has no register '" + run.options.show + "'");
    run.options.window ? run_in_window(drawn) : run_for_pictures(drawn);
  } catch (const ui::PictureError& error) {
    outcome.wrong = error.what();
  }
  // Closing the window or a signal ends a program that could go on.
  outcome.status =
      drawn.session.mode() == debugger::Mode::kOver ? drawn.session.status() : vm::Status::kEnded;
  if (stop_flag()) outcome.status = vm::Status::kInterrupted;
  outcome.error = drawn.session.vm().error();
  outcome.ticks = drawn.session.ticks();
  outcome.spent = drawn.session.vm().profile();
  return outcome;
}

}  // namespace apron::run
