/* What a shared object must offer so that a program can call it: !module('name'), then y = plugin(?, n, a,
 * b).
 *
 * A module exports two functions with C linkage, apron_plugin_version and apron_plugin_call. It is loaded
 * once, before the program runs, and is called on the program's one thread. It must not keep what it is given
 * after a call, and must not throw C++ exceptions out of it. docs/extending.md has an example. */
#ifndef APRON_PLUGIN_H
#define APRON_PLUGIN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define APRON_PLUGIN_VERSION 1

/* An argument: a register, or a number where `cells` is null. Row y of a register, 0 north, begins at
 * cells + y * pitch; its `width` floats go from west to east. */
typedef struct apron_argument {
  const float* cells;
  uint32_t width, height;
  ptrdiff_t pitch; /* in floats */
  float value;
} apron_argument;

typedef struct apron_call {
  int32_t operation; /* the n of plugin(?, n, …) */
  uint32_t argument_count;
  const apron_argument* arguments;
  /* Where a register is written: its cells as they are, to be changed in place. All may be written: the
   * program's mask is applied afterwards. No argument overlaps it. Null where none is written. */
  float* cells;
  uint32_t width, height;
  ptrdiff_t pitch;
  /* Where a scalar is written: the value as it is. Null where none is. */
  float* value;
  /* What went wrong, for a call that does not return 0: one line, ending in a zero byte. */
  char message[256];
} apron_call;

/* Must return APRON_PLUGIN_VERSION. */
int apron_plugin_version(void);

/* Returns 0, or anything else with a message: the program then ends with it. */
int apron_plugin_call(apron_call* call);

#ifdef __cplusplus
}
#endif

#endif
