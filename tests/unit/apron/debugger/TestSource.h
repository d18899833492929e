// Compiles programs and conditions from text for the tests of debugger and UI.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "apron/debugger/DebugSession.h"
#include "apron/debugger/Listing.h"
#include "apron/run/ui/ConditionCompiler.h"
#include "tests/unit/apron/compiler/CompileText.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::debugger::test {

using vm::Status;
using vm::test::FakeHost;

struct CompiledSource {
  program::Program program;
  std::vector<SourceText> texts;
};

// Compiles for 8 x 6 cells; the main file is main.aps.
inline CompiledSource compile(const std::string& text, const std::map<std::string, std::string>& files = {}) {
  compiler::CompileResult result = compiler::compile_text(text, files);
  EXPECT_TRUE(result.program) << compiler::errors(result);
  CompiledSource compiled;
  if (result.program) compiled.program = std::move(*result.program);
  for (std::uint32_t i = 0; i < result.sources.file_count(); ++i) {
    const syntax::SourceFile& file = result.sources.file(i);
    SourceText source{file.name, file.text, std::nullopt, file.included_from.line};
    if (file.included_from.line > 0) source.included_in = file.included_from.file;
    compiled.texts.push_back(source);
  }
  return compiled;
}

inline program::Program compile_condition(const std::string& text, const program::Program& debuggee) {
  std::string error;
  auto program = run::compile_condition(text, debuggee, 8, 6, error);
  EXPECT_TRUE(program) << error;
  return program ? std::move(*program) : program::Program{};
}

// Lines 4 to 8 increment `count` once per tick. A is the count in every cell except (0, 0), which is 100.
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
