// Drives a view model and its debug session on one thread, like the window's loop without a clock.
#pragma once

#include <memory>
#include <string>

#include "apron/debugger/PanelHost.h"
#include "apron/ui/ViewModel.h"
#include "tests/unit/apron/debugger/TestSource.h"

namespace apron::ui::test {

struct UiFixture {
  explicit UiFixture(const std::string& text, const std::map<std::string, std::string>& files = {})
      : host(inner, panel), model(panel, compile_condition) {
    debugger::test::CompiledSource code = debugger::test::compile(text, files);
    session = std::make_unique<debugger::DebugSession>(code.program, vm::VmOptions{}, host);
    model.speed_shown = false;
    model.show_program(code.program, code.texts, 1);
    process_commands();
  }
  // Executes pending commands, advances the session `slices` times and takes a snapshot.
  void process_commands(int slices = 1) {
    for (ViewModel::SessionCommand& command : model.take_commands()) command(*session);
    while (slices-- > 0) session->advance();
    debugger::DebugSnapshot snapshot;
    session->capture_snapshot(model.snapshot_request(), snapshot);
    model.update(std::move(snapshot));
  }
  void replace(const std::string& text) {
    debugger::test::CompiledSource code = debugger::test::compile(text);
    session->replace(code.program);
    model.show_program(code.program, code.texts, 2);
    process_commands();
  }
  static ViewModel::CompiledCondition compile_condition(const std::string& condition,
                                                        const program::Program& debuggee) {
    ViewModel::CompiledCondition compiled;
    compiled.program = run::compile_condition(condition, debuggee, 8, 6, compiled.error);
    return compiled;
  }

  vm::test::FakeHost inner;
  debugger::FrontPanel panel;
  debugger::PanelHost host;
  ViewModel model;
  std::unique_ptr<debugger::DebugSession> session;
};

}  // namespace apron::ui::test
