//! The paper's figures from our own runs, and the tables of studies as pictures.

pub mod fig1;
pub mod fig3;
pub mod fig5;
pub mod fig6;
pub mod fig7;
pub mod fig8;
pub mod rates;
