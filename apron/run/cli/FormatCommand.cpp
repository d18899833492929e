// `apron fmt`.
#include "apron/syntax/Formatter.h"

#include "apron/run/cli/Commands.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/SourceManager.h"
#include "common/files/ReadFile.h"
#include "common/text/Printable.h"

namespace apron::run {
namespace {

// The lexer's diagnostics as text, or empty.
std::string lexical_errors(const std::string& file, const std::string& text) {
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  syntax::lex(sources, sources.add_file(file, text, {}), diagnostics);
  return diagnostics.empty() ? "" : syntax::format_diagnostics(diagnostics.take(), sources);
}

}  // namespace

int format_programs(const Options& options) {
  int status = common::kDone;
  for (const std::string& file : options.files) {
    try {
      const std::string text = read_file(file, common::kMaxTextBytes);
      if (const std::string errors = lexical_errors(file, text); !errors.empty()) {
        common::print_message(errors);
        status = common::kUserError;
        continue;
      }
      const std::string result = syntax::format_source(text);
      if (options.check_only) {
        if (result == text) continue;
        common::print_output(file + "\n");
        if (status == common::kDone) status = common::kFailed;
      } else if (!options.write) {
        common::print_output(result);
      } else if (result != text) {
        write_file(file, result);
      }
    } catch (const MediaError& error) {
      common::print_message("apron: error: " + std::string(error.what()) + "\n");
      status = common::kUserError;
    }
  }
  return status;
}

}  // namespace apron::run
