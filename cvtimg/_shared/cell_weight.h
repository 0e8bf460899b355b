/* How much the energy of a cell counts: its share of the mass to a power, the `volume_power` of the Python side. */
#ifndef CVTIMG_CELL_WEIGHT_H
#define CVTIMG_CELL_WEIGHT_H

#include <math.h>

static inline double cell_weight(double share, double power)
{
    if (power == 0)
        return 1;
    if (power == 1)
        return share;
    if (power == 2)
        return share * share;
    return pow(share, power);
}

#endif
