// Diagnostics collected by the compiler's stages, and their rendering.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "apron/syntax/SourceManager.h"

namespace apron::syntax {

struct Note {
  Location location;
  std::string message;
};

struct Diagnostic {
  Location location;
  std::string message;
  std::vector<Note> notes =
      {};  // "declared here" and the like; include and macro chains come from the location
  bool is_warning = false;
  bool is_conditional = false;  // see conditional_error()
};

inline constexpr std::size_t kMaxErrors = 20;
// Includes repeats, as from a macro with an error that is expanded many times.
inline constexpr std::size_t kMaxReportedErrors = 2000;

class Diagnostics {
 public:
  Diagnostics() = default;
  // Keeps that many errors, repeats in other expansions of a macro included.
  explicit Diagnostics(std::size_t max_errors) : max_errors_(max_errors), keeps_repeats_(true) {}

  // Keeps an error once that is reported twice, as by a macro that is expanded twice, and at most kMaxErrors.
  void error(Location location, std::string message, std::vector<Note> notes = {});
  // One that a macro's body may not have in another call: by an `!error`, or for the sizes of arrays.
  void conditional_error(Location location, std::string message);
  // The last one: errors after it would follow from it.
  void final_error(Location location, std::string message);
  // Does not refuse the program. At most kMaxErrors are kept.
  void warning(Location location, std::string message);
  bool full() const noexcept { return full_; }
  bool empty() const noexcept { return diagnostics_.empty(); }  // of errors
  // Both sorted by location: files in inclusion order, then line and column.
  std::vector<Diagnostic> take();
  std::vector<Diagnostic> take_warnings();

 private:
  std::vector<Diagnostic> diagnostics_, warnings_;
  std::size_t max_errors_ = kMaxErrors;
  bool keeps_repeats_ = false;
  std::size_t report_count_ = 0;
  bool full_ = false;
};

// "file:line:col: error: text", or "warning", the source line, a line with a caret below the column, then one
// line per note, macro expansion and include that leads to it.
std::string format_diagnostics(const Diagnostic&, const SourceManager&);
std::string format_diagnostics(const std::vector<Diagnostic>&, const SourceManager&);

}  // namespace apron::syntax
