/* Linear elasticity in the logarithmic strain, with the faults that macros choose. */
#include <math.h>
#include <stddef.h>
#include <unistd.h>

#include "mpm_law.h"

int32_t mpm_law_abi(void)
{
#ifdef WRONG_ABI
    return 2;
#else
    return MPM_LAW_ABI;
#endif
}

void mpm_law_sizes(struct mpm_sizes *sizes)
{
    sizes->size = sizeof *sizes;
    sizes->n_parameters = 2;
    sizes->n_history = 1;
#ifdef WRONG_SIZE
    sizes->size = 16;
#endif
#ifdef WRONG_COUNT
    sizes->n_history = -1;
#endif
}

#ifndef NO_PARAMETERS
void mpm_law_parameter(int64_t number, struct mpm_variable *parameter)
{
    parameter->name = number == 0 ? "young" : "poisson";
    parameter->unit = number == 0 ? "stress" : "-";
#ifdef NO_NAME
    if (number == 1) parameter->name = NULL;
#endif
#ifdef EMPTY_NAME
    if (number == 1) parameter->name = "";
#endif
#ifdef NOT_UTF8
    if (number == 1) parameter->name = "poi\xff";
#endif
#ifdef NOT_A_WORD
    if (number == 1) parameter->name = "poisson's ratio";
#endif
#ifdef TWICE
    parameter->name = "young";
#endif
}
#endif

void mpm_law_history(int64_t number, struct mpm_variable *variable)
{
    (void)number;
    variable->name = "largest_strain";
    variable->unit = "-";
    variable->initial = 0.0;
#ifdef TAKEN_NAME
    variable->name = "pressure";
#endif
#ifdef NAN_INITIAL
    variable->initial = NAN;
#endif
}

#ifdef UNDEFINED
double not_in_any_library(double);
#endif

#ifdef NOT_FOR_THREADS
static double trace;
#endif

#ifndef NO_UPDATE
int32_t mpm_law_update(const double *p, const double trial[6], const double *old_history, double *new_history,
                       double stress[6], double elastic_strain[6], double tangent[36])
{
    const double shear = p[0] / (2.0 * (1.0 + p[1])), lame = 2.0 * shear * p[1] / (1.0 - 2.0 * p[1]);
#ifndef NOT_FOR_THREADS
    double trace;
#endif
    trace = trial[0] + trial[1] + trial[2];
#ifdef NOT_FOR_THREADS
    usleep(10);
#endif
    for (int i = 0; i < 6; i++) {
        elastic_strain[i] = trial[i];
        stress[i] = 2.0 * shear * trial[i] + (i < 3 ? lame * trace : 0.0);
        for (int j = 0; j < 6; j++) {
            tangent[6 * i + j] = (i < 3 && j < 3 ? lame : 0.0) + (i == j ? (i < 3 ? 2.0 : 1.0) * shear : 0.0);
        }
    }
    new_history[0] = fmax(old_history[0], fabs(trial[1]));
#ifdef WRONG_TANGENT
    for (int i = 3; i < 6; i++) tangent[7 * i] *= 2.0;
#endif
#ifdef NOT_SYMMETRIC
    stress[0] += 0.1 * shear * trial[1];
    tangent[1] += 0.1 * shear;
#endif
#ifdef NOT_PURE
    static int calls = 0;
    stress[0] += 1e-3 * shear * calls++;
#endif
#ifdef UNDEFINED
    stress[0] = not_in_any_library(stress[0]);
#endif
#ifdef NO_NUMBER
    if (trial[1] < -NO_NUMBER) stress[0] = NAN;
#endif
#ifdef ALWAYS_REFUSES
    return 42;
#endif
#ifdef NEVER_A_NUMBER
    stress[0] = NAN;
#endif
#ifdef REFUSES
    if (trial[1] < -REFUSES) return 7;
#endif
    return 0;
}
#endif

#ifdef MEASURE
int32_t mpm_law_measure(void) { return MEASURE; }
#endif

#ifdef NO_SMALL_NUMBERS
#include <xmmintrin.h>
__attribute__((constructor)) static void flush(void) { _mm_setcsr(_mm_getcsr() | 0x8040); }
#endif
