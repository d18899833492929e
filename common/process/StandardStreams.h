// Keeps the standard streams of a program from being mistaken for its files.
#pragma once

namespace common {

// Opens those of the descriptors 0, 1 and 2 that the caller has closed, so that no file that the program
// opens becomes one of them: its messages would go into that file. What is opened refuses the stream's use:
// reading standard input and writing the others fails. Call it first in main(). Ends the process with status
// 1 if a descriptor cannot be opened.
void open_standard_streams() noexcept;

}  // namespace common
