// `apron repl`: executes a program typed line by line and prints its registers.
#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/host/LocalHost.h"
#include "apron/run/options/Options.h"

namespace apron::run {

using Print = std::function<void(std::string_view)>;

// Each entry (a line or a complete block) is compiled and run together with all accepted entries. The
// accepted entries are replayed without output and without writing files, which restores the program's state.
// An entry that fails is discarded. An expression shows its value.
class Repl {
 public:
  // options are copied; in must outlive this. prompts: whether to print prompts.
  Repl(const Options& options, std::istream& in, Print print, bool prompts);

  // Reads entries until the end of the input, :quit or a stop signal.
  void run();

 private:
  enum class Outcome { kSuccess, kCompileError, kRuntimeError };
  struct Result {
    Outcome outcome = Outcome::kSuccess;
    std::string report = {};   // of errors
    std::uint32_t column = 0;  // of the first error of compilation, if it is in the text's own line
  };

  bool handle_command(const std::string& line);
  void handle_entry(const std::string& text);
  // Runs the accepted entries followed by `text`.
  Result compile_and_run(const std::string& text);
  void show_names();
  void show_value(const std::string& name);
  void save(const std::string& file);

  Options options_;
  std::istream& in_;
  Print print_;
  bool prompts_;
  std::vector<std::string> accepted_;  // entries, each with its final line end
  struct NamedValue {
    std::string name;
    std::uint32_t width = 0, height = 0;  // 0 for a scalar
    std::vector<float> cells;             // row-major
  };
  std::vector<NamedValue> values_;  // registers and scalars after the last successful entry
};

int run_repl(const Options& options);

// True if the text has an unclosed block, macro or conditional directive, or ends in a line continuation.
bool is_incomplete(const std::string& text);

// Renders row-major cells as characters, denser for larger values, at most `columns` wide. The last line
// states the size and the range.
std::string format_register_ascii(const std::vector<float>& cells, std::uint32_t width, std::uint32_t height,
                                  std::uint32_t columns);

}  // namespace apron::run
