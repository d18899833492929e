// A workbench with its session, on one thread: what the window's loop does, without a clock.
#pragma once

#include <memory>
#include <string>

#include "apron/debugger/PanelHost.h"
#include "apron/ui/Workbench.h"
#include "tests/unit/apron/debugger/Programs.h"

namespace apron::ui::test {

struct Desk {
  explicit Desk(const std::string& text, const std::map<std::string, std::string>& files = {})
      : host(inner, panel), bench(panel, ask) {
    debugger::test::Compiled code = debugger::test::compiled(text, files);
    session = std::make_unique<debugger::Session>(code.program, vm::VmOptions{}, host);
    bench.clocked = false;
    bench.show_program(code.program, code.texts, 1);
    obey();
  }
  // The orders, so many slices of the program, a look.
  void obey(int slices = 1) {
    for (Workbench::Order& order : bench.take_orders()) order(*session);
    while (slices-- > 0) session->advance();
    debugger::Look look;
    session->look(bench.request(), look);
    bench.update(std::move(look));
  }
  void replace(const std::string& text) {
    debugger::test::Compiled code = debugger::test::compiled(text);
    session->replace(code.program);
    bench.show_program(code.program, code.texts, 2);
    obey();
  }
  static Workbench::Question ask(const std::string& condition, const program::Program& watched) {
    Workbench::Question question;
    question.program = run::compile_question(condition, watched, 8, 6, question.wrong);
    return question;
  }

  vm::test::FakeHost inner;
  debugger::FrontPanel panel;
  debugger::PanelHost host;
  Workbench bench;
  std::unique_ptr<debugger::Session> session;
};

}  // namespace apron::ui::test
