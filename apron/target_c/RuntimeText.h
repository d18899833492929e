// The parts of the generated code that are the same for all programs; CMake makes them from runtime/.
#pragma once

#include <string_view>

namespace apron::target_c::runtime {

extern const std::string_view kHeader, kSource, kArithmetic, kIntegers, kWide, kWhole, kDouble, kAngle,
    kMathematics, kRandom, kRandomInteger, kExchange, kRun;

}  // namespace apron::target_c::runtime
