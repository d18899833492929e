// Translates lists of instructions, one a line, as code generators print them: y = op(a, b) or op(y, a, b).
#pragma once

#include <string_view>

#include "apron/run/import/KernelTranslation.h"

namespace apron::run {

class InstructionListReader final : KernelTranslation {
 public:
  InstructionListReader(const KernelVocabulary& vocabulary, const ImportOptions& options)
      : KernelTranslation(vocabulary, options) {
    in_kernel_ = true;
  }

  ImportedKernels translate(std::string_view text);

 private:
  void translate_row();
  void translate_statement();
};

}  // namespace apron::run
