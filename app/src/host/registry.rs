//! The tools there are, in the order they are shown.

use std::fmt;

use thiserror::Error;

use super::tool::{Tool, ToolId};

/// Why a tool was not added.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RegistryError {
    /// Another tool has the id.
    #[error("two tools are called \"{id}\"; give one of them another id")]
    Duplicate {
        /// The id.
        id: ToolId,
    },
}

/// A list of tools without two of one id.
#[derive(Default)]
pub struct Registry {
    tools: Vec<Box<dyn Tool>>,
}

impl fmt::Debug for Registry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.tools.iter().map(|t| t.id())).finish()
    }
}

impl Registry {
    /// Adds a tool in its first state.
    ///
    /// # Errors
    /// [`RegistryError::Duplicate`].
    pub fn add<T: Tool + Default + 'static>(&mut self) -> Result<(), RegistryError> {
        let tool = T::default();
        let id = tool.id();
        if self.tools.iter().any(|t| t.id() == id) {
            return Err(RegistryError::Duplicate { id });
        }
        self.tools.push(Box::new(tool));
        Ok(())
    }

    /// Ids and titles, in order.
    pub fn titles(&self) -> impl Iterator<Item = (ToolId, &'static str)> {
        self.tools.iter().map(|t| (t.id(), t.title()))
    }

    /// The tool of that id.
    pub fn tool(&self, id: ToolId) -> Option<&dyn Tool> {
        self.tools.iter().find(|t| t.id() == id).map(|t| &**t)
    }

    /// The tool of that id, to draw its panel or pass it the pointer.
    pub fn tool_mut(&mut self, id: ToolId) -> Option<&mut (dyn Tool + 'static)> {
        self.tools.iter_mut().find(|t| t.id() == id).map(|t| &mut **t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::context::ToolContext;

    #[derive(Default)]
    struct Blank;

    impl Tool for Blank {
        fn id(&self) -> ToolId {
            ToolId("blank")
        }
        fn title(&self) -> &'static str {
            "Blank"
        }
        fn panel_ui(&mut self, _ctx: &mut ToolContext<'_>, _ui: &mut egui::Ui) {}
    }

    #[test]
    fn a_second_tool_of_one_id_is_refused() {
        let mut registry = Registry::default();
        assert_eq!(registry.add::<Blank>(), Ok(()), "the first");
        let again = registry.add::<Blank>();
        assert_eq!(again, Err(RegistryError::Duplicate { id: ToolId("blank") }), "the second");
        assert_eq!(registry.titles().count(), 1, "and is not in the list");
    }
}
