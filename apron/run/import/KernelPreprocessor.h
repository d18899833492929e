// The preprocessor of C++ for kernels: local includes, conditions, and macros.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/import/ImportedKernels.h"
#include "apron/run/import/KernelTokens.h"

namespace apron::run {

using KernelTokenList = std::vector<KernelToken>;

class KernelPreprocessor {
 public:
  // Both arguments must outlive this.
  KernelPreprocessor(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : vocabulary_(vocabulary), options_(options) {}

  // Tokens without directives, macros expanded; none of a text whose brackets are nested too deeply, which
  // the readers take apart once for each of them. Two kinds of macros stay and have a directive where they
  // are defined, because they read better as defines and macros of APRON and mean the same there: names of
  // numbers, and statements whose parameters are operands of calls.
  KernelTokenList run(std::string_view text);

  const std::vector<ImportNote>& notes() const { return notes_; }
  // The names of the files by the numbers in the tokens; "" for the kernel's own.
  const std::vector<std::string>& files() const { return files_; }

 private:
  struct Macro {
    std::vector<std::string> parameters;
    KernelTokenList body;
    bool is_function = false, is_kept = false;
  };
  using Names = std::set<std::string>;

  void read(std::string_view text, std::size_t file, const std::string& folder);
  void directive(const KernelToken& token, const std::string& folder);
  void include(const KernelToken& token, const std::string& folder);
  void define(const KernelToken& token);
  void refuse(const KernelToken& at, std::string reason);
  bool refuse_depth(const KernelTokenList& tokens);
  KernelTokenList without_names(const KernelTokenList& in) const;
  bool makes_words(const Macro& macro) const;
  bool condition(const KernelToken& token, std::string_view expression);
  bool is_active() const;
  bool may_stay(const std::string& name, const Macro&) const;
  // Appends the token at i, or what it expands to, and moves i behind it.
  void expand(const KernelTokenList& in, std::size_t& i, const Names& hidden, KernelTokenList& out);
  KernelTokenList expand_all(const KernelTokenList& in, const Names& hidden);
  KernelTokenList substitute(const Macro&, const std::vector<KernelTokenList>& arguments, const Names& hidden,
                             const KernelToken& call);

  const KernelVocabulary& vocabulary_;
  const ImportOptions& options_;
  std::map<std::string, Macro> macros_;
  std::set<std::string> defined_;  // names that have been macros
  std::size_t expanded_ = 0;       // tokens that macros have become
  std::set<std::string> included_;
  std::vector<std::string> files_;
  std::vector<ImportNote> notes_;
  struct Branch {
    bool is_active, was_taken, is_enclosed;  // is_enclosed: inside an active branch
  };
  std::vector<Branch> branches_;
  KernelTokenList out_;
  bool is_too_deep_ = false;
};

// The arguments between two positions, which commas outside brackets separate. Leaves comments out.
std::vector<KernelTokenList> split_arguments(const KernelTokenList& tokens, std::size_t first,
                                             std::size_t last);
// The position after the bracket that closes the one at `open`; the end of the tokens if it is not closed.
std::size_t behind_bracket(const KernelTokenList& tokens, std::size_t open);

}  // namespace apron::run
