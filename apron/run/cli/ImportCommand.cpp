// `apron import`.

#include "apron/run/cli/Commands.h"
#include "apron/run/import/KernelImport.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/options/CompiledProgram.h"
#include "common/files/Inputs.h"
#include "common/text/Printable.h"

namespace apron::run {

namespace {

const char* kind_of(const ImportNote& note) {
  if (note.severity == Severity::kError) return ": error: ";
  if (note.severity == Severity::kWarning) return ": warning: ";
  return note.in_kernel ? ": not translated: " : ": left out: ";
}

}  // namespace

// Exit status: 1 if a line of a kernel was not translated, 2 if the program would compute something else than
// the text, or if there is no kernel; nothing is written then.
int import_program(const Options& options) {
  try {
    const KernelVocabulary vocabulary = read_vocabulary(read_file(find_library_file("scamp5.aps")));
    const std::size_t name = options.program.find_last_of('/') + 1;
    const std::string folder = options.program.substr(0, name);
    const auto read_include = [&](const std::string& file) -> std::optional<std::string> {
      try {
        return read_file(folder + file);
      } catch (const MediaError&) {
        return std::nullopt;
      }
    };
    const ImportedKernels imported =
        import_kernels(read_file(options.program), vocabulary,
                       {options.program.substr(name), options.picture, read_include});
    bool is_complete = true, is_wrong = false;
    for (const ImportNote& note : imported.notes) {
      common::print_message((note.file.empty() ? options.program : folder + note.file) + ":" +
                            std::to_string(note.line) + kind_of(note) + note.text + "\n");
      is_complete = is_complete && !note.in_kernel;
      is_wrong = is_wrong || note.severity == Severity::kError;
    }
    if (is_wrong) return common::kUserError;
    if (imported.instructions == 0) {
      common::print_message(options.program + ": error: there is no instruction of a SCAMP-5 kernel\n");
      return common::kUserError;
    }
    if (options.output.empty()) {
      common::print_output(imported.program);
    } else {
      common::require_separate_outputs(std::vector<common::NamedOutput>{{"--output", options.output}});
      write_file(options.output, imported.program);
    }
    return is_complete ? common::kDone : common::kFailed;
  } catch (const MediaError& error) {
    common::print_message("apron: error: " + std::string(error.what()) + "\n");
    return common::kUserError;
  }
}

}  // namespace apron::run
