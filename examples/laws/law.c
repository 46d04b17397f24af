/* A constitutive law for mpm in C: von Mises plasticity with linear isotropic hardening, the law `von-mises` of decks.
 *
 *     cc -O2 -shared -fPIC law.c -o law.so -lm
 *
 * Copy this file and mpm_law.h, which describes the interface, and replace what is specific to this law.
 */
#include <math.h>
#include <stddef.h>

#include "mpm_law.h"

/* Parameters, in the order of `parameter_list`. */
enum { YOUNG, POISSON, YIELD, HARDENING, N_PARAMETERS };

static const struct mpm_variable parameter_list[N_PARAMETERS] = {
    {"young", "stress", 0.0},
    {"poisson", "-", 0.0},
    {"deviatoric_yield_stress", "stress", 0.0}, /* the norm of the stress deviator at yield */
    {"hardening_modulus", "stress", 0.0},       /* its growth per equivalent plastic strain */
};

/* History variables, in the order of `history_list`. */
enum { EQUIVALENT_PLASTIC_STRAIN, N_HISTORY };

static const struct mpm_variable history_list[N_HISTORY] = {
    {"equivalent_plastic_strain", "-", 0.0},
};

/* The square root of 2/3: growth of the equivalent plastic strain per norm of the plastic strain increment. */
static const double EQUIVALENT = 0.81649658092772603;

/* Stresses beyond the yield surface by less than this part are elastic, so that round-off does not choose between the
 * tangents of a point that has yielded before. */
static const double ON_SURFACE = 1e-10;

int32_t mpm_law_abi(void) { return MPM_LAW_ABI; }

void mpm_law_sizes(struct mpm_sizes *sizes)
{
    sizes->size = sizeof *sizes;
    sizes->n_parameters = N_PARAMETERS;
    sizes->n_history = N_HISTORY;
}

void mpm_law_parameter(int64_t number, struct mpm_variable *parameter) { *parameter = parameter_list[number]; }

void mpm_law_history(int64_t number, struct mpm_variable *variable) { *variable = history_list[number]; }

const char *mpm_law_refuse(const double *p)
{
    if (!(p[YOUNG] > 0.0)) return "young must be above 0";
    if (!(p[POISSON] > -1.0 && p[POISSON] < 0.5)) return "poisson must be above -1 and below 0.5";
    if (!(p[YIELD] > 0.0)) return "deviatoric_yield_stress must be above 0";
    if (!(p[HARDENING] >= 0.0)) return "hardening_modulus must be at least 0";
    return NULL;
}

static double bulk_modulus(const double *p) { return p[YOUNG] / (3.0 * (1.0 - 2.0 * p[POISSON])); }

static double shear_modulus(const double *p) { return p[YOUNG] / (2.0 * (1.0 + p[POISSON])); }

/* Radial return: the trial deviator s is scaled back along n = s/|s|. */
int32_t mpm_law_update(const double *p, const double trial[6], const double *old_history, double *new_history,
                       double stress[6], double elastic_strain[6], double tangent[36])
{
    const double bulk = bulk_modulus(p), shear = shear_modulus(p);
    const double trace = trial[0] + trial[1] + trial[2];
    double s[6], n[6], square = 0.0;
    for (int i = 0; i < 6; i++) {
        s[i] = 2.0 * shear * (i < 3 ? trial[i] - trace / 3.0 : trial[i]);
        square += (i < 3 ? 1.0 : 2.0) * s[i] * s[i];
    }
    const double norm = sqrt(square);
    const double reached = p[YIELD] + p[HARDENING] * old_history[EQUIVALENT_PLASTIC_STRAIN];

    double flow = 0.0;  /* norm of the plastic strain increment */
    double ratio = 1.0; /* |s| after the return over that before */
    double along = 0.0; /* stiffness lost along n */
    if (norm < reached * (1.0 + ON_SURFACE)) {
        for (int i = 0; i < 6; i++) n[i] = 0.0;
    } else {
        const double growth = EQUIVALENT * p[HARDENING];
        flow = (norm - reached) / (2.0 * shear + growth);
        ratio = (reached + flow * growth) / norm;
        along = 2.0 * shear * ratio - 2.0 * shear * growth / (2.0 * shear + growth);
        for (int i = 0; i < 6; i++) n[i] = s[i] / norm;
    }
    for (int i = 0; i < 6; i++) {
        stress[i] = ratio * s[i] + (i < 3 ? bulk * trace : 0.0);
        elastic_strain[i] = trial[i] - flow * n[i];
    }
    new_history[EQUIVALENT_PLASTIC_STRAIN] = old_history[EQUIVALENT_PLASTIC_STRAIN] + EQUIVALENT * flow;

    /* D = lambda I x I + 2 mu 1 - along n x n; in components, the identity 1 has 1 in normal and 1/2 in shear components. */
    const double mu = ratio * shear, lambda = bulk - 2.0 / 3.0 * mu;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            const double volumetric = i < 3 && j < 3 ? lambda : 0.0;
            const double diagonal = i == j ? (i < 3 ? 2.0 * mu : mu) : 0.0;
            tangent[6 * i + j] = volumetric + diagonal - along * n[i] * n[j];
        }
    }
    return 0;
}

/* All that follows is optional. */

double mpm_law_energy(const double *p, const double elastic_strain[6], const double *history)
{
    (void)history;
    const double bulk = bulk_modulus(p), shear = shear_modulus(p);
    const double trace = elastic_strain[0] + elastic_strain[1] + elastic_strain[2];
    double square = 0.0;
    for (int i = 0; i < 6; i++) {
        const double e = i < 3 ? elastic_strain[i] - trace / 3.0 : elastic_strain[i];
        square += (i < 3 ? 1.0 : 2.0) * e * e;
    }
    return 0.5 * bulk * trace * trace + shear * square;
}

double mpm_law_plastic_work(const double *p, const double *history)
{
    const double strain = history[EQUIVALENT_PLASTIC_STRAIN];
    return (p[YIELD] + 0.5 * p[HARDENING] * strain) * strain / EQUIVALENT;
}

int32_t mpm_law_elastic_strain(const double *p, const double stress[6], const double *history, double elastic_strain[6])
{
    (void)history;
    const double bulk = bulk_modulus(p), shear = shear_modulus(p);
    const double trace = stress[0] + stress[1] + stress[2];
    for (int i = 0; i < 6; i++) {
        const double deviator = i < 3 ? stress[i] - trace / 3.0 : stress[i];
        elastic_strain[i] = deviator / (2.0 * shear) + (i < 3 ? trace / (9.0 * bulk) : 0.0);
    }
    return 0;
}

int32_t mpm_law_tangent_is_symmetric(const double *p)
{
    (void)p;
    return 1;
}

int32_t mpm_law_measure(void) { return 0; }
