/* A surface without physics: two discs drift over the cells, and pins follow their targets with a first-order
 * lag. The sensor values depend on the tick alone, so that any frame can be verified. C99. */
#ifndef TOY_H
#define TOY_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TOY_RANGE 6.0f   /* of the proximity sensors */
#define TOY_HIGHEST 4.0f /* of the pins */

/* 1 if a disc covers the cell at that tick, else 0. */
int toy_hit(uint32_t rows, uint32_t columns, uint64_t tick, uint32_t row, uint32_t column);

/* The pin's height one period later. */
float toy_follow(float height, float target);

#ifdef __cplusplus
}
#endif

#endif
