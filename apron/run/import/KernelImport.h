// `apron import`: translates SCAMP-5 kernels, in the C++ of the chip's public tutorials or in the instruction
// lists that code generators print, into a program that includes scamp5.aps.
#pragma once

#include <string_view>

#include "apron/run/import/ImportedKernels.h"

namespace apron::run {

KernelVocabulary read_vocabulary(std::string_view library);

ImportedKernels import_kernels(std::string_view text, const KernelVocabulary&, const ImportOptions&);

}  // namespace apron::run
