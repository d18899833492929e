// `apron fmt`.
#include "apron/syntax/Formatter.h"

#include <iostream>

#include "apron/run/Commands.h"
#include "apron/run/MediaError.h"
#include "apron/run/MediaFile.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Lexer.h"
#include "apron/syntax/SourceManager.h"

namespace apron::run {
namespace {

// "" or what is wrong with the words of a file, for the user.
std::string wrong_words(const std::string& file, const std::string& text) {
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  syntax::lex(sources, sources.add_file(file, text, {}), diagnostics);
  return diagnostics.empty() ? "" : syntax::format_diagnostics(diagnostics.take(), sources);
}

}  // namespace

int format_programs(const Options& options) {
  int status = kDone;
  for (const std::string& file : options.files) {
    try {
      const std::string text = read_file(file);
      if (const std::string wrong = wrong_words(file, text); !wrong.empty()) {
        std::cerr << wrong;
        status = kWrongInput;
        continue;
      }
      const std::string result = syntax::format_source(text);
      if (options.only_check) {
        if (result == text) continue;
        std::cout << file << '\n';
        if (status == kDone) status = kRunFailed;
      } else if (!options.write) {
        std::cout << result;
      } else if (result != text) {
        write_file(file, result);
      }
    } catch (const MediaError& error) {
      std::cerr << "apron: error: " << error.what() << '\n';
      status = kWrongInput;
    }
  }
  return status;
}

}  // namespace apron::run
