// `apron repl`: executes a program typed line by line and prints its registers.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "apron/run/cli/Options.h"
#include "apron/run/host/LocalHost.h"

namespace apron::run {

// Each entry (a line, or a block with its end) is compiled with all that were accepted before it and run;
// what came before is run again unseen and without writing files, so that the state is that of the program so
// far. An entry with an error leaves nothing behind. An expression shows its value.
class Repl {
 public:
  // Reads from in until its end or :quit; prompts only if wanted.
  Repl(const Options& options, std::istream& in, std::ostream& out, bool prompts);

  void run();

 private:
  enum class Outcome { kSuccess, kCompileError, kRuntimeError };

  bool handle_command(const std::string& line);
  void handle_entry(const std::string& text);
  // Compiles and runs the accepted lines and `text`; errors go to `report`.
  Outcome compile_and_run(const std::string& text, std::string& report);
  void show_names();
  void show_value(const std::string& name);
  bool replay(std::string& report);

  Options options_;
  std::istream& in_;
  std::ostream& out_;
  bool prompts_;
  std::vector<std::string> accepted_;  // entries, each ending in a line end
  struct NamedValue {
    std::string name;
    std::uint32_t width = 0, height = 0;  // 0: a scalar
    std::vector<float> cells;             // row by row
  };
  std::vector<NamedValue> values_;  // registers and scalars after the last entry
};

int run_repl(const Options& options);

// Whether the lines so far open a block, a macro or a bracketed line that they do not close.
bool is_incomplete(const std::string& text);

// A register as characters, a darker one for a larger value, at most `columns` wide, with its range below.
std::string format_register_ascii(const std::vector<float>& cells, std::uint32_t width, std::uint32_t height,
                                  std::uint32_t columns);

}  // namespace apron::run
