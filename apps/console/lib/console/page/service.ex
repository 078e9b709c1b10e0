defmodule Console.Page.Service do
  @moduledoc """
  Defines what is served by the web server of the page in place of the page, such as a protocol that other programs speak on a
  WebSocket. The configuration names services for the commands:

      config :console, services: [foxglove: {8765, Bridge.Foxglove}]
  """
  alias Console.Page

  @doc "How its address begins: `ws` or `http`."
  @callback scheme() :: String.t()

  @doc "What asks the fleet for its scenes; `module` and `live` as in `Console.Live`."
  @callback feed(%{module: module(), live: term(), robots: (... -> [atom()])}) ::
              Supervisor.child_spec()

  @doc "Answers a request, in the process of its connection (`Console.Page.Http`)."
  @callback answer(Page.Http.request(), page :: map()) :: term()

  @doc """
  What listens in the place of the page's own door (`Console.Page.Door`, whose options it gets), for programs that speak no HTTP. These
  cannot say the page's token, so they are served on this machine alone.
  """
  @callback door(%{address: :inet.ip_address(), port: :inet.port_number(), page: map()}) ::
              Supervisor.child_spec()

  @optional_callbacks answer: 2, door: 1

  @doc "The services of this build: name, port and module."
  @spec all() :: [{atom(), {:inet.port_number(), module()}}]
  def all, do: Application.get_env(:console, :services, [])

  @doc """
  Serves those that were asked for, by name and port, beside a page with these options (`t:Console.Page.option/0`); returns a line for
  each, which says where it is, or why it is not.
  """
  @spec start([{atom(), :inet.port_number()}], [Page.option()]) :: [line :: String.t()]
  def start(asked, options) do
    for {name, port} <- asked do
      {_port, module} = Keyword.fetch!(all(), name)

      with true <- Code.ensure_loaded?(module),
           {:ok, _page, url} <-
             Page.start_link(Keyword.merge(options, service: module, port: port)) do
        "#{String.capitalize("#{name}")}:  #{url}"
      else
        false -> "no #{name}: #{inspect(module)} is not in this build"
        {:error, line} -> "no #{name}: #{line}"
      end
    end
  end
end
