// std::to_chars and std::from_chars of floating-point numbers, as the standard defines them, but for
// chars_format::hex, which is an invalid argument.
#pragma once

#include <charconv>

namespace smartsurf::web::libcxx {

std::to_chars_result to_chars(char* first, char* last, float value);
std::to_chars_result to_chars(char* first, char* last, double value);
std::to_chars_result to_chars(char* first, char* last, float value, std::chars_format);
std::to_chars_result to_chars(char* first, char* last, double value, std::chars_format);

std::from_chars_result from_chars(const char* first, const char* last, float& value,
                                  std::chars_format = std::chars_format::general);
std::from_chars_result from_chars(const char* first, const char* last, double& value,
                                  std::chars_format = std::chars_format::general);

}  // namespace smartsurf::web::libcxx
