// Fuzzes compiler, formatter and VM with arbitrary bytes as source text: the text compiles or yields
// diagnostics, a compiled program passes the verifier and runs, and formatting is idempotent. Nothing may
// crash, hang or exhaust memory.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/Formatter.h"
#include "tests/fuzz/apron/RunBounded.h"

namespace {

using namespace apron;

constexpr std::size_t kMaxBytes = std::size_t{1} << 16;

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: %s\n", what);
  std::abort();
}

// Serves the library from disk and the fuzzed program as main.aps; refuses all other files.
class Reader final : public syntax::FileReader {
 public:
  explicit Reader(std::string text) : text_(std::move(text)) {}
  std::optional<std::string> read(const std::string& path) override {
    const std::string library = APRON_SCRIPTS;
    if (path == "main.aps") return text_;
    const bool inside = path.compare(0, library.size(), library) == 0 && path.find("..") == std::string::npos;
    return inside ? disk_.read(path) : std::nullopt;
  }

 private:
  std::string text_;
  syntax::DiskReader disk_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > kMaxBytes) return 0;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::string once = syntax::format_source(text);
  require(syntax::format_source(once) == once, "formatting is not idempotent");
  compiler::CompileOptions options;
  options.file = "main.aps";
  options.width = 7;
  options.height = 5;
  options.library_path = APRON_SCRIPTS;
  Reader reader(text);
  compiler::CompileResult result = compiler::compile(options, reader);
  require(result.program.has_value() == result.diagnostics.empty(),
          "both a program and diagnostics, or neither");
  if (!result.program) {
    require(!syntax::format_diagnostics(result.diagnostics, result.sources).empty(),
            "diagnostics without text");
    return 0;
  }
  require(program::verify(*result.program).empty(), "the verifier refuses a compiled program");
  program::disassemble(*result.program);
  fuzz::run_bounded(std::move(*result.program));
  return 0;
}
