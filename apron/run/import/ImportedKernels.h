// The input and the result of an import of kernels.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace apron::run {

// The instructions of a machine's library: the numbers of arguments of each macro.
struct KernelVocabulary {
  std::map<std::string, std::set<std::size_t>> statements;  // without a result
  std::map<std::string, std::set<std::size_t>> values;      // with one
  std::set<std::string> names;                              // registers, defines and directions
};

enum class Severity {
  kNote,     // the line is not translated
  kWarning,  // the line is translated, and the chip computes something else
  kError,    // without the line the program would compute something else
};

// What the import says about a line.
struct ImportNote {
  std::size_t line = 0;
  std::string text;
  Severity severity = Severity::kNote;
  bool in_kernel = false;  // false for the program around the kernels, which runs on the controller
  std::string file;        // the included file, "" for the kernel's own
};

struct ImportedKernels {
  std::string program;
  std::vector<ImportNote> notes;
  std::size_t instructions = 0;  // translated
};

struct ImportOptions {
  std::string source_name;  // for the comment at the top
  std::string picture;      // a file that becomes the light; "" for none
  // The text of a file that `#include "name"` names, relative to the kernel's folder; nothing if it is not
  // there.
  std::function<std::optional<std::string>(const std::string& name)> read_include;
};

}  // namespace apron::run
