// `apron import`.

#include "apron/run/cli/Commands.h"
#include "apron/run/import/KernelImport.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/options/CompiledProgram.h"
#include "common/files/Inputs.h"
#include "common/text/Printable.h"

namespace apron::run {

// Exit status: 1 if a line of a kernel was not translated, 2 if there is no kernel.
int import_program(const Options& options) {
  try {
    const KernelVocabulary vocabulary = read_vocabulary(read_file(find_library_file("scamp5.aps")));
    const std::string source_name = options.program.substr(options.program.find_last_of('/') + 1);
    const ImportedKernels imported =
        import_kernels(read_file(options.program), vocabulary, {source_name, options.picture});
    bool is_complete = true;
    for (const ImportNote& note : imported.notes) {
      common::print_message(options.program + ":" + std::to_string(note.line) +
                            (note.in_kernel ? ": not translated: " : ": left out: ") + note.text + "\n");
      is_complete = is_complete && !note.in_kernel;
    }
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
