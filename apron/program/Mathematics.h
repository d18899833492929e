// The mathematical functions of one number; vm/kernels/MathematicsKernels.cpp has those of vectors, with the
// same bits.
#pragma once

#include "apron/program/Program.h"

namespace apron::program {

// The value of an instruction that is_mathematics().
float evaluate_mathematics(Opcode op, float a, float b) noexcept;

// The nearest multiple of pi / 2 to x, modulo 4, and the distance from it, to 53 bits. x is a 32-bit float of
// 2^20 or more; NaN for infinity and NaN.
struct ReducedAngle {
  double quadrant = 0.0, rest = 0.0;
};
ReducedAngle reduce_angle(double x) noexcept;
// r, up to pi / 2 in size, with sin(r) = sin(x + ahead pi / 2) for whole `ahead`, of such an x.
double turn_angle(float x, double ahead) noexcept;

}  // namespace apron::program
