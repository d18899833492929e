// Programs from text, a listing of them, and a host whose surface counts: for the tests of debugger and ui.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "apron/debugger/Listing.h"
#include "apron/debugger/Session.h"
#include "apron/run/Question.h"
#include "tests/unit/apron/compiler/CompileText.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::debugger::test {

using vm::Status;
using vm::test::FakeHost;

struct Compiled {
  program::Program program;
  std::vector<SourceText> texts;
};

// Of 8 x 6 cells; the main file is main.aps.
inline Compiled compiled(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  compiler::CompileResult result = compiler::compile_text(text, files);
  EXPECT_TRUE(result.program) << compiler::errors(result);
  Compiled all;
  if (result.program) all.program = std::move(*result.program);
  for (std::uint32_t i = 0; i < result.sources.file_count(); ++i) {
    const syntax::SourceFile& file = result.sources.file(i);
    SourceText one{file.name, file.text, std::nullopt, file.included_from.line};
    if (file.included_from.line > 0) one.included_in = file.included_from.file;
    all.texts.push_back(one);
  }
  return all;
}

inline program::Program question(const std::string& text, const program::Program& watched) {
  std::string wrong;
  auto program = run::compile_question(text, watched, 8, 6, wrong);
  EXPECT_TRUE(program) << wrong;
  return program ? std::move(*program) : program::Program{};
}

// Lines 4 to 8 count up, tick after tick; A is the count in every cell but (0, 0), which is 100.
inline const char* const kCounting = R"(!register(A, B)
sim.slider.add('gain', 0, 10, 1)
count = 0
while(1)
  count = count + 1
  A = count * sim.slider.get('gain')
  pixel.set(A, 0, 0, 100)
  surface.step
endwhile
)";

}  // namespace apron::debugger::test
